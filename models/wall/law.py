"""How a soft wall pushes back: a spring in N/m, realised exactly by MuJoCo's soft contact."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco

from haustra.errors import InvalidOptionError

_IMPEDANCE_RANGE = (1e-4, 0.9999)
"""MuJoCo clamps impedance to this range (mjMINIMP, mjMAXIMP)."""

IMPEDANCE_RATIO = 10.0
"""Stiffness of friction over that of the normal (MuJoCo's impratio). Friction below Coulomb's limit is a damper of this
times (c + h K): with 1, at K = 1500 N/m and h = 5 ms, a scope held by 1 N creeps at 67 mm/s and feels its full friction
only when it moves faster; with 10 at 7 mm/s, in as many iterations. 100 takes three times as many."""


@dataclass(frozen=True)
class WallContact:
    """Stiffness, damping and friction between a device and the wall."""

    stiffness: float
    """Normal stiffness K of one contact [N/m]."""
    damping: float
    """Normal damping c of one contact [N s/m]."""
    friction: float
    """Coulomb coefficient [1]."""

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping"):
            value = getattr(self, name)
            if not 0 < value < 1e9:
                raise InvalidOptionError(f"Wall {name} is {value}; it must be positive and below 1e9.")
        if not 0 <= self.friction <= 5:
            raise InvalidOptionError(f"Friction is {self.friction}; it must be between 0 and 5.")


def apply_contact(
    spec: mujoco.MjSpec, bare: mujoco.MjModel, geoms: Sequence[str], contact: WallContact, *, timestep: float
) -> None:
    """Give geoms of moving bodies the contact law F = K d + c d', integrated by backward Euler.

    MuJoCo's contact force is f = (-b v - k d r - a) / R with R = (1 - d) A / d, where A approximates the inverse
    inertia (`body_invweight0`), d is the impedance and a the acceleration in the contact. A backward Euler step of the
    spring and damper, F = -K (r + h v') - c v' with v' = v + h a, is the same expression when

        1/R = h (c + h K),   k d = K R,   b = (c + h K) R,

    which fixes the impedance, d = A / (A + R). The static stiffness is then exactly K, at any place along a chain and
    for any mass, and the contact is stable at any time step. Elliptic cones only: with pyramidal ones R also scales
    with friction.

    Args:
        spec: the scene that holds the geoms.
        bare: the same moving bodies compiled at rest, for their inverse inertia; it need not hold the wall.
        geoms: names of geoms of moving bodies. They get priority over the wall's own parameters.
        contact: the law.
        timestep: the time step h it is integrated with [s].
    """
    spec.option.impratio = IMPEDANCE_RATIO
    for name in geoms:
        inverse_inertia = bare.body_invweight0[bare.geom_bodyid[bare.geom(name).id], 0]
        geom = spec.geom(name)
        geom.solref, geom.solimp = contact_parameters(inverse_inertia, contact, timestep=timestep, where=name)
        geom.friction = [contact.friction, 0.0, 0.0]
        geom.condim = 3 if contact.friction > 0 else 1
        geom.priority = 1


def soft_contact(inverse_inertia: Any, stiffness: Any, damper: Any, *, timestep: Any) -> tuple[Any, Any, Any]:
    """Both numbers of solref, and the impedance, of the law of `apply_contact`: numbers, or arrays of numpy or JAX.

    Args:
        inverse_inertia: `body_invweight0` [1/kg].
        stiffness: K [N/m].
        damper: c + h K [N s/m].
        timestep: h [s].
    """
    impedance = inverse_inertia / (inverse_inertia + 1 / (timestep * damper))
    scale = (1 - impedance) * inverse_inertia
    return -stiffness * scale, -damper * scale, impedance


def contact_parameters(
    inverse_inertia: float, contact: WallContact, *, timestep: float, where: str
) -> tuple[list[float], list[float]]:
    """MuJoCo's solref and solimp that give a body of that `body_invweight0` [1/kg] the law of `apply_contact`.

    Raises:
        InvalidOptionError: when MuJoCo would clamp the impedance; `where` names the place in the message.
    """
    implicit_damping = contact.damping + timestep * contact.stiffness
    low, high = _IMPEDANCE_RANGE
    spring, damper, impedance = soft_contact(inverse_inertia, contact.stiffness, implicit_damping, timestep=timestep)
    if not low < impedance < high:
        raise InvalidOptionError(
            f"Wall stiffness {contact.stiffness} N/m at a time step of {timestep} s is outside what MuJoCo can "
            f"honour on '{where}': change the stiffness or the time step."
        )
    return [spring, damper], [
        impedance,
        impedance,
        0.001,
        0.5,
        2,
    ]  # constant impedance: width, midpoint, power have no effect
