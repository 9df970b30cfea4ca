"""An inchworm on the virtual bench."""

from typing import Any

import numpy as np

from haustra.models.devices.inchworm.interface import PADS, Inchworm
from haustra.scripts.bench.devices import row


def figures(device: Inchworm) -> dict[str, Any]:
    """What a balloon holds with, and speed without slip."""
    grip = np.linspace(0.05, 0.8, 16)
    normal = PADS * device.pad_area * device.pressure
    rows = [
        row("largest insertion width (ISO 8600-4), balloons empty", 1e3 * device.diameter, "mm"),
        row("works in lumens to", 1e3 * device.balloon_diameter, "mm"),
        row("force of a balloon on the wall", normal, "N"),
        row("holding force of a balloon", device.grip * normal, "N"),
        row("speed without slip", 1e3 * device.stroke / device.gait.period, "mm/s"),
    ]
    return {"rows": rows, "curves": {"anchor": {"grip": grip.tolist(), "force_N": (grip * normal).tolist()}}}
