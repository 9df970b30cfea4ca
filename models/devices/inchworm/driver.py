"""The simplest gait of two anchors and a body that extends: fixed times, whatever the wall does."""

from dataclasses import dataclass
from types import ModuleType
from typing import Any

from haustra.models.devices.base import DeviceReadings

_GAIN = 1.5
"""Bend that is steered for over the angle between the front and the lumen ahead [1]; engineering choice."""


@dataclass(frozen=True)
class Gait:
    """Four parts of a cycle, one after the other: hold behind, extend, hold in front, contract."""

    hold: float
    """Time in which one balloon fills and then the other empties, half of it each [s]."""
    move: float
    """Time in which the body extends, and in which it contracts [s]."""

    @property
    def period(self) -> float:
        """Time of a whole cycle [s]."""
        return 2 * (self.hold + self.move)


def crawl(
    xp: ModuleType, seen: DeviceReadings, gait: Gait, *, limits: tuple[float, float, float], stiffness: float
) -> Any:
    """Pressures, length and steering torques (worlds, 5).

    Both balloons hold while they change over, so that one always does.

    Args:
        xp: numpy or jax.numpy.
        seen: what all devices can be told by.
        gait: times.
        limits: pressure [Pa], stroke [m] and largest steering torque [N m].
        stiffness: of the joint that is steered [N m/rad].
    """
    pressure, stroke, torque = limits
    phase, half = seen.time % gait.period, gait.hold + gait.move
    later = phase >= half
    within = xp.where(later, phase - half, phase)
    changing, moved = within < gait.hold / 2, xp.clip((within - gait.hold) / gait.move, 0.0, 1.0)
    rear, front = (xp.where(now | changing, pressure, 0.0) for now in (~later, later))
    length = stroke * xp.where(later, 1 - moved, moved)
    local = xp.einsum("wij,wi->wj", seen.tip_frame, seen.ahead)
    across = xp.maximum(xp.sqrt((local[:, :2] ** 2).sum(axis=1)), 1e-9)
    turn = _GAIN * stiffness * (xp.arctan2(across, local[:, 2]) / across)[:, None] * local[:, :2]
    steer = xp.clip(xp.stack([-turn[:, 1], turn[:, 0]], axis=1), -torque, torque)
    return xp.concatenate([rear[:, None], front[:, None], length[:, None], steer], axis=1)
