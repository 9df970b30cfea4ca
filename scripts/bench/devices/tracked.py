"""The tracked robot on the virtual bench."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from haustra.errors import HaustraError
from haustra.models.devices.tracked.drive import drive_point
from haustra.models.devices.tracked.interface import TrackedRobot
from haustra.scripts.bench.devices import row


def figures(device: TrackedRobot) -> dict[str, Any]:
    """Propulsion against friction, width and speed, by the balance of the rigs."""
    design = device.design
    width = np.linspace(design.smallest_diameter, design.largest_diameter, 9)[1:-1]

    def forces(points: Sequence[tuple[float, float, float]]) -> list[float | None]:
        return [_force(design, *point) for point in points]

    frictions, speeds = np.linspace(0.05, 0.6, 12), np.array([75.0, 112.5, 150.0, 225.0, 300.0])
    usual = device.friction, 150.0, design.nominal_diameter
    curves = {
        "friction": {"friction": frictions.tolist(), "force_N": forces([(mu, *usual[1:]) for mu in frictions])},
        "speed": {"rpm": speeds.tolist(), "force_N": forces([(usual[0], rpm, usual[2]) for rpm in speeds])},
        "width": {"width_mm": (1e3 * width).tolist(), "force_N": forces([(*usual[:2], each) for each in width])},
    }
    rows = [
        row("largest insertion width (ISO 8600-4), treads drawn in", 1e3 * design.smallest_diameter, "mm"),
        row("works in lumens from", 1e3 * design.smallest_diameter, "mm"),
        row("works in lumens to", 1e3 * design.largest_diameter, "mm"),
        row("propulsion at 150 rpm, nominal width", _force(design, *usual), "N"),
    ]
    return {"rows": rows, "curves": curves}


def _force(design: Any, friction: float, rpm: float, diameter: float) -> float | None:
    try:
        return float(drive_point(design, friction, rpm, diameter=diameter).force)
    except HaustraError:
        return None
