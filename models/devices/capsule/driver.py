"""The simplest drivers of a body that is pulled: along the lumen's axis, and back a little when the wall presses."""

from types import ModuleType
from typing import Any

from haustra.models.devices.base import DeviceReadings
from haustra.models.devices.capsule.magnet import distance_for

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
    share, until = _share(xp, seen, memory, safe_force)
    force = limits[0] * share[:, None] * seen.ahead
    torque = _ALIGN * limits[1] * xp.cross(seen.tip_frame[..., 2], seen.ahead)
    if own_frame:
        force, torque = (xp.einsum("wij,wi->wj", seen.tip_frame, vector) for vector in (force, torque))
    return xp.concatenate([force, torque], axis=1), until


def lead(
    xp: ModuleType,
    seen: DeviceReadings,
    memory: Any,
    moments: tuple[float, float],
    force: float,
    standoff: float,
    half: float,
    *,
    safe_force: float,
) -> tuple[Any, Any]:
    """Place and direction of a magnet (worlds, 6) that draws the body as `drive` would, and memory as there.

    The magnet stands in line with the body's middle and the lumen ahead, its moment the same way: it draws the body to
    itself and turns it there. To back off it stands behind.

    Args:
        xp: numpy or jax.numpy.
        seen: what all devices can be told by.
        memory: what this returned last; zero at first.
        moments: sizes of the dipole moments of the magnet outside and of that inside [A m^2].
        force: largest force that is asked for [N].
        standoff: least distance of the magnets [m]: nearer is not asked for.
        half: from the body's middle to its tip [m].
        safe_force: wall force beyond which it backs off [N].
    """
    share, until = _share(xp, seen, memory, safe_force)
    away = xp.maximum(distance_for(*moments, force * xp.abs(share)), standoff)
    middle = seen.tip - half * seen.tip_frame[..., 2]
    return xp.concatenate([middle + (xp.sign(share) * away)[:, None] * seen.ahead, seen.ahead], axis=1), until


def _share(xp: ModuleType, seen: DeviceReadings, memory: Any, safe_force: float) -> tuple[Any, Any]:
    """Share of the largest force (worlds,), negative to back off, and until when it does (worlds,) [s]."""
    until = xp.where((seen.wall_force > safe_force) & (seen.time >= memory), seen.time + _BACK_OFF, memory)
    return xp.where(seen.time < until, -_RETREAT * _PULL, _PULL), until
