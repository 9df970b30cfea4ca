"""An everting endoscope on the virtual bench."""

import math
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.models.devices.tether import tether_tension
from haustra.models.devices.vine.interface import Vine
from haustra.scripts.bench.device_bench import tube
from haustra.scripts.bench.devices import row


def figures(device: Vine) -> dict[str, Any]:
    """What is measured of its body as an insertion tube, and what its pressure presses the tip with."""
    found = tube(device.body.design, wires=False)
    return {"rows": [*found["rows"], *_growth(device)], "curves": found["curves"] | _growth_curves(device)}


def _growth(device: Vine) -> list[dict[str, Any]]:
    return [
        row("tip force at the anus", float(_left(device, np.zeros(1))[0]), "N"),
        row("tip force behind four turns of 180 degrees", float(_left(device, np.array([4 * math.pi]))[0]), "N"),
        row("bend at which the tail holds it", _holds(device), "degrees"),
    ]


def _left(device: Vine, turned: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """What the pressure leaves for the tip behind bends [N], a metre inside."""
    bends = turned[:, None] * np.linspace(0.0, 1.0, 65)
    law = {"friction": device.tail_friction, "mass_per_length": device.tail_mass_per_length, "held": device.tail_held}
    tail = tether_tension(np, bends, np.ones(len(turned)), **law)
    return (device.pressure - device.eversion_pressure) * device.area - tail


def _holds(device: Vine) -> float:
    turned = np.linspace(0.0, 100.0, 2001)
    left = _left(device, turned)
    return float(np.degrees(turned[np.argmax(left <= 0)])) if (left <= 0).any() else math.inf


def _growth_curves(device: Vine) -> dict[str, Any]:
    turned = np.linspace(0.0, 12 * math.pi, 60)
    force = np.maximum(_left(device, turned), 0.0)
    return {"growth": {"turned_deg": np.degrees(turned).tolist(), "force_N": force.tolist()}}
