"""Stops of joints: MuJoCo's soft limits made into springs of known stiffness, so that angles end where they should."""

from typing import Any

import mujoco

STOP_STIFFNESS = 150.0
"""Torque per angle beyond a stop [N m/rad]; engineering choice: a full pull, 0.3 N m, turns each joint 0.1 degrees
past it; stops of 500 N m/rad chatter at 4 ms. MuJoCo's default yields ten times as much."""

STOP_RELAXATION_TIME = 0.01
"""Damping over stiffness of a stop [s]; engineering choice."""

_IMPEDANCE_RANGE = (1e-4, 0.9999)


def stop_damping(timestep: Any) -> Any:
    """Damping of a stop, and what a time step [s] of its spring adds [N m s/rad]."""
    return STOP_STIFFNESS * (STOP_RELAXATION_TIME + timestep)


def apply_stops(spec: mujoco.MjSpec, bare: mujoco.MjModel, *, timestep: float) -> None:
    """Give every limited hinge of a scope a stop of `STOP_STIFFNESS`, integrated by backward Euler.

    The derivation is that of `haustra.models.wall.law.apply_contact`, with the joint's inverse inertia in place of the
    contact's.

    Args:
        spec: the scene that holds the scope.
        bare: the same scope compiled at rest, for its inverse inertia.
        timestep: the time step [s].
    """
    damping = stop_damping(timestep)
    low, high = _IMPEDANCE_RANGE
    for index in range(bare.njnt):
        name = bare.joint(index).name
        if not (name.startswith("scope/") and bare.jnt_limited[index]):
            continue
        inverse_inertia = bare.dof_invweight0[bare.jnt_dofadr[index]]
        impedance = min(
            max(inverse_inertia * timestep * damping / (1 + inverse_inertia * timestep * damping), low), high
        )
        scale = (1 - impedance) * inverse_inertia
        joint = spec.joint(name)
        joint.solref_limit = [-STOP_STIFFNESS * scale, -damping * scale]
        joint.solimp_limit = [impedance, impedance, 0.001, 0.5, 2]
