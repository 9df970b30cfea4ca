"""`haustra doctor`: what works on this machine."""

import os
import platform
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any


@dataclass(frozen=True)
class Doctor:
    """Print versions, engines and rendering back-ends that work here."""

    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Probe the machine."""
        from haustra.envs.picture.backends import probe_backends
        from haustra.provenance import package_versions

        return {
            "platform": platform.platform(),
            "cores": os.cpu_count(),
            "versions": package_versions(),
            "engines": _engines(),
            "rendering": {"software": "works", **probe_backends()},
            "mujoco_gl": os.environ.get("MUJOCO_GL", "not set"),
        }


def _engines() -> dict[str, str]:
    """Each engine and whether haustra can run it here."""
    needs = {"mjx-jax": ("mujoco-mjx", "mujoco.mjx"), "mjx-warp": ("warp-lang", "warp")}
    verdicts = {"native": "works"}
    for engine, (package, module) in needs.items():
        installed = find_spec(module) is not None
        verdicts[engine] = f"{package} is installed; this version runs native only" if installed else f"no {package}"
    return verdicts
