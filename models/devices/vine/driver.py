"""The simplest driver of a body that grows: on towards the lumen ahead, and back a little when the wall presses."""

from types import ModuleType
from typing import Any

from haustra.models.devices.base import DeviceReadings

_BACK_OFF = 0.5
"""How long it draws back [s]; engineering choice."""
_GAIN = 1.0
"""Bend that is steered for over the angle between tip and lumen ahead [1]; engineering choice."""


def drive(
    xp: ModuleType, seen: DeviceReadings, memory: Any, *, limits: tuple[float, float, float], safe_force: float
) -> tuple[Any, Any]:
    """Growth, pressure and bends (worlds, 4), and until when it draws back (worlds,) [s].

    Args:
        xp: numpy or jax.numpy.
        seen: what all devices can be told by.
        memory: what this returned last; zero at first.
        limits: speed of growth [m/s], pressure [Pa] and largest bend [rad].
        safe_force: wall force beyond which it draws back [N].
    """
    speed, pressure, largest = limits
    until = xp.where((seen.wall_force > safe_force) & (seen.time >= memory), seen.time + _BACK_OFF, memory)
    local = xp.einsum("wij,wi->wj", seen.tip_frame, seen.ahead)
    across = xp.maximum(xp.sqrt((local[:, :2] ** 2).sum(axis=1)), 1e-9)
    bend = xp.clip(_GAIN * (xp.arctan2(across, local[:, 2]) / across)[:, None] * local[:, :2], -largest, largest)
    grow = xp.where(seen.time < until, -speed / 2, speed)[:, None]
    return xp.concatenate([grow, pressure + xp.zeros_like(grow), bend], axis=1), until
