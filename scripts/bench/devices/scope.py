"""A scope on the virtual bench."""

from typing import Any

from haustra.models.devices.scope.interface import Scope
from haustra.scripts.bench.curved_tube import curved_figures
from haustra.scripts.bench.device_bench import tube
from haustra.scripts.bench.devices import row


def figures(device: Scope) -> dict[str, Any]:
    """What is measured of its insertion tube, and of it in curved tubes."""
    found, (rows, insertion) = tube(device.design), curved_figures(device.design)
    return {"rows": [*found["rows"], *(row(*each) for each in rows)], "curves": found["curves"] | {"loop": insertion}}
