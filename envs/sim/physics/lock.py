"""Shaft outside the patient is held straight; its joints are freed smoothly as they pass the anus."""

from typing import Any

from jaxtyping import Float

from haustra.models.devices.scope.cable import LOCK_STRETCH


def lock_activation(
    xp: Any, insertion: Float[Any, "*worlds"], behind: Float[Any, "*joints"]
) -> Float[Any, "*activation"]:
    """How firmly joints are held, from 0 inside the patient to 1 further than `LOCK_STRETCH` outside.

    Args:
        xp: numpy or jax.numpy.
        insertion: length of scope past the anus [m]; with a last axis of one where `behind` has worlds or joints.
        behind: distance of each joint from the tip [m].
    """
    return xp.clip((behind - insertion) / LOCK_STRETCH, 0.0, 1.0) ** 4
