"""A magnet-led capsule on the virtual bench."""

import math
from typing import Any

import numpy as np

from haustra.models.devices.capsule.interface import Capsule
from haustra.models.devices.capsule.magnet import PERMEABILITY
from haustra.scripts.bench.devices import row


def figures(device: Capsule) -> dict[str, Any]:
    """Largest pull against distance."""
    distance = np.linspace(0.05, 0.3, 26)
    pull = 6 * PERMEABILITY * device.moment * device.outside_moment / (4 * math.pi * distance**4)
    turn = 2 * PERMEABILITY * device.moment * device.outside_moment / (4 * math.pi * distance**3)
    rows = [
        row("largest insertion width (ISO 8600-4)", 1e3 * device.diameter, "mm"),
        row("pull at the stand-off, in line", float(np.interp(device.standoff, distance, pull)), "N"),
        row("torque at the stand-off, in line", float(np.interp(device.standoff, distance, turn)), "N m"),
    ]
    return {"rows": rows, "curves": {"magnet": {"distance_m": distance.tolist(), "force_N": pull.tolist()}}}
