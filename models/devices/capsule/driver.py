"""The simplest driver of a body that is pulled: along the lumen's axis, and back a little when the wall presses."""

from types import ModuleType
from typing import Any

from haustra.models.devices.base import DeviceReadings

_PULL = 0.5
"""Share of the largest force [1]; engineering choice."""
_BACK_OFF = 0.4
"""How long it backs off [s]; engineering choice."""
_RETREAT = 0.4
"""Share of the pull, backwards [1]; engineering choice."""
_ALIGN = 0.5
"""Share of the largest torque that is asked for at 90 degrees between body and lumen [1]; engineering choice."""


def drive(
    xp: ModuleType,
    seen: DeviceReadings,
    memory: Any,
    *,
    limits: tuple[float, float],
    safe_force: float,
    own_frame: bool,
) -> tuple[Any, Any]:
    """Force and torque (worlds, 6) in the scene's axes or the body's own, and until when it backs off (worlds,) [s].

    Args:
        xp: numpy or jax.numpy.
        seen: what all devices can be told by.
        memory: what this returned last; zero at first.
        limits: largest force [N] and torque [N m] along an axis.
        safe_force: wall force beyond which it backs off [N].
        own_frame: give force and torque in the body's own axes.
    """
    until = xp.where((seen.wall_force > safe_force) & (seen.time >= memory), seen.time + _BACK_OFF, memory)
    share = xp.where(seen.time < until, -_RETREAT * _PULL, _PULL)
    force = limits[0] * share[:, None] * seen.ahead
    torque = _ALIGN * limits[1] * xp.cross(seen.tip_frame[..., 2], seen.ahead)
    if own_frame:
        force, torque = (xp.einsum("wij,wi->wj", seen.tip_frame, vector) for vector in (force, torque))
    return xp.concatenate([force, torque], axis=1), until
