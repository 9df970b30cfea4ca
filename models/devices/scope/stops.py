"""Stops of joints: MuJoCo's soft limits made into springs of known stiffness, so that angles end where they should."""

from typing import Any

import mujoco

from haustra.models.wall.law import honoured_contact, solimp

STOP_STIFFNESS = 150.0
"""Torque per angle beyond a stop [N m/rad]; engineering choice: a full pull, 0.3 N m, turns each joint 0.1 degrees
past it; stops of 500 N m/rad chatter at 4 ms. MuJoCo's default yields ten times as much."""

STOP_RELAXATION_TIME = 0.01
"""Damping over stiffness of a stop [s]; engineering choice."""


_HARDEST = 4999.0
"""Largest A h (c + h K) of a stop [1], A being the joint's inverse inertia: an impedance of 0.9998, just within
MuJoCo's bounds."""


def stop_damping(timestep: Any) -> Any:
    """Damping of a stop, and what a time step [s] of its spring adds [N m s/rad]."""
    return STOP_STIFFNESS * (STOP_RELAXATION_TIME + timestep)


def apply_stops(spec: mujoco.MjSpec, bare: mujoco.MjModel, *, timestep: float) -> None:
    """Give every limited hinge of a scope a stop of `STOP_STIFFNESS`, integrated by backward Euler.

    The derivation is that of `haustra.models.wall.law.soft_contact`, with the joint's inverse inertia in place of the
    contact's. Links of next to no inertia get the hardest stop that MuJoCo can honour, which is softer.

    Args:
        spec: the scene that holds the scope.
        bare: the same scope compiled at rest, for its inverse inertia.
        timestep: the time step [s].

    Raises:
        InvalidOptionError: when MuJoCo cannot honour such a stop at this time step.
    """
    damping = stop_damping(timestep)
    for index in range(bare.njnt):
        name = bare.joint(index).name
        if not (name.startswith("scope/") and bare.jnt_limited[index]):
            continue
        inverse_inertia = bare.dof_invweight0[bare.jnt_dofadr[index]]
        share = min(1.0, _HARDEST / (inverse_inertia * timestep * damping))
        own = share * STOP_STIFFNESS, share * damping
        soft = honoured_contact(inverse_inertia, *own, timestep=timestep, what=f"The stop of '{name}'")
        joint = spec.joint(name)
        joint.solref_limit, joint.solimp_limit = soft.solref, solimp(float(soft.impedance))
