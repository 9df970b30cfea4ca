"""The hand at the handle: a spring and a damper along and about the shaft, of limited force and torque."""

from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.models.devices.scope.cable import HAND_PUSH, HAND_ROLL

HAND_STIFFNESS, HAND_DAMPING = np.array([HAND_PUSH, HAND_ROLL]).T
"""Along the shaft [N/m], [N s/m], and about it [N m/rad], [N m s/rad]."""


def hand_force(
    xp: Any,
    aim: Float[Any, "*worlds 2"],
    place: Float[Any, "*worlds 2"],
    speed: Float[Any, "*worlds 2"],
    limit: Float[Any, "*any 2"],
) -> Float[Any, "*worlds 2"]:
    """Force along the shaft [N] and torque about it [N m] on a handle that is at `place` and moves.

    Args:
        xp: numpy or jax.numpy.
        aim: where the hand aims [m, rad].
        place: where the handle is [m, rad].
        speed: of the handle [m/s, rad/s].
        limit: largest force and torque of the hand [N, N m].
    """
    stiffness, damping = (xp.asarray(part, place.dtype) for part in (HAND_STIFFNESS, HAND_DAMPING))
    return held_force(xp, aim, place, speed, limit, stiffness, damping)


def held_force(xp: Any, aim: Any, place: Any, speed: Any, limit: Any, stiffness: Any, damping: Any) -> Any:
    """`hand_force` along or about the shaft, by that stiffness and damping."""
    return xp.clip(stiffness * (aim - place) - damping * speed, -limit, limit)
