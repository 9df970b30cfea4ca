"""Where and when a benchmark was measured."""

import os
import platform
from datetime import UTC, datetime
from pathlib import Path

from haustra.provenance import package_versions
from haustra.scripts.bench.result import Value


def machine() -> dict[str, Value]:
    """Date, versions and processor, which figures of speed need beside them."""
    return {
        "date": datetime.now(UTC).date().isoformat(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
        **package_versions(),
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.machine()
