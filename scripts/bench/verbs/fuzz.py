"""`haustra bench fuzz`: whether any file crashes or hangs what reads it."""

from dataclasses import dataclass, field
from typing import Any

from haustra.fields import whole


@dataclass(frozen=True)
class BenchFuzz:
    """Read damaged meshes, label maps and configurations in child processes; count crashes, hangs and tracebacks."""

    meshes: int = whole(0, 10**9, default=20_000)
    """Number of damaged surface meshes, in six formats."""
    maps: int = whole(0, 10**9, default=2_000)
    """Number of damaged label maps, in three formats (needs the extra 'ct')."""
    documents: int = whole(0, 10**9, default=4_000)
    """Number of damaged devices, designs and studies in TOML, and trainings and tasks in JSON."""
    seed: int = whole(0, 2**63 - 1, default=0)
    """Seed of all random damage."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Read all of them."""
        import os
        import time

        from haustra.scripts.bench.fuzz.run import FINDINGS, KINDS, fuzz
        from haustra.scripts.console import progress_bar

        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        began, found = time.perf_counter(), {}
        for kind in KINDS:
            count = getattr(self, kind)
            with progress_bar(kind, count, unit="files") as advance:
                found[kind] = fuzz(kind, count, seed=self.seed, tell=lambda done, tell=advance: tell(done, ""))
        findings = sum(counts.get(name, 0) for counts in found.values() for name in FINDINGS)
        return {**found, "findings": findings, "seconds": time.perf_counter() - began}
