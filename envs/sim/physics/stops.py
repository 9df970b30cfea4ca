"""Stops of joints by backward Euler: MuJoCo's soft limits as `haustra.models.devices.scope.stops` sets them."""

from typing import Any

from jaxtyping import Float

from haustra.models.devices.scope.stops import STOP_STIFFNESS, stop_damping


def stop_torque(
    xp: Any,
    angles: Float[Any, "*worlds dofs"],
    low: Float[Any, "*any dofs"],
    high: Float[Any, "*any dofs"],
    *,
    timestep: Any,
) -> tuple[Float[Any, "*worlds dofs"], Float[Any, "*worlds dofs"]]:
    """Torque of the stops' springs [N m], and the damping of a step that is implicit in them [N m s/rad].

    Args:
        xp: numpy or jax.numpy.
        angles: of the joints [rad].
        low: lower stops [rad]; minus infinity where there is none.
        high: upper stops [rad]; infinity where there is none.
        timestep: [s].
    """
    over = xp.maximum(angles - high, 0.0) - xp.maximum(low - angles, 0.0)
    return -STOP_STIFFNESS * over, xp.where(over != 0, stop_damping(timestep), 0.0)
