"""A scope on the virtual bench."""

from typing import Any

from haustra.models.devices.scope.interface import Scope
from haustra.scripts.bench.device_bench import tube


def figures(device: Scope) -> dict[str, Any]:
    """What is measured of its insertion tube."""
    return tube(device.design)
