"""`haustra doctor`: what works on this machine."""

import os
import platform
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any


@dataclass(frozen=True)
class Doctor:
    """Print versions, backends and rendering back-ends that work here."""

    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Probe the machine."""
        from haustra.envs.view.picture.backends import probe_backends
        from haustra.provenance import package_versions

        asked = os.environ.get("MUJOCO_GL", "")
        return {
            "platform": platform.platform(),
            "cores": os.cpu_count(),
            "versions": package_versions(),
            "backends": _backends(),
            "rendering": {"software": "works", **probe_backends()},
            "mujoco_gl": "not set" if asked in ("", "disable") else asked,  # `main` disables it where it is not set
        }


def _backends() -> dict[str, str]:
    """Each backend, and what of haustra it can run here."""
    needs = {
        "warp": (
            "warp",
            "warp",
            "rigs: sweep; scopes: vector environments; bench; fast on NVIDIA GPUs only",
        ),
    }
    verdicts = {"native": "works: everything", "linear": "works: scopes by the lumen's table, one or many"}
    for backend, (module, extra, use) in needs.items():
        installed = find_spec("mujoco.mjx") is not None and find_spec(module) is not None
        verdicts[backend] = f"installed: {use}" if installed else f"not installed: pip install 'haustra[{extra}]'"
    return verdicts
