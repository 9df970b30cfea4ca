"""How a soft wall pushes back on a device and rubs it: one law for every backend.

A place of the device that is d deep in the wall (a sphere of radius r whose centre is r - d from it) is pushed along
the wall's normal n, and rubbed across it, with

    F   = max(0, E(d) + tau E'(d) d'),
    f_t = -mu(v) F v_t / max(|v_t|, v_s),    mu(v) = mu + m |v_t|,

where E is the wall's elasticity (`haustra.models.wall.elasticity`), K d unless a scene chooses another, and tau the
time in which it relaxes: K is the slope of E at no depth, and c = tau K. v_t is the speed of the device's surface
against the wall's. Both act at the device's surface, centre - r n: the wall is indented until it touches it there. v_s,
the slip speed (`SLIP_SPEED`), makes friction a function of the speed at any load: below it, friction is a damper of
mu F / v_s, so a device that Coulomb's law would hold creeps at less than v_s. m is zero but for a wall under a film of
mucus, on which friction rises with the speed.

A step h of it by backward Euler is F = E - (tau + h) E' v_n', with E and its slope E' at its beginning, for a place
that leaves the wall at v_n' at the step's end, and the friction of the load and speed at its beginning over that speed,
times the speed at its end: a spring, a damper and a drag (`implicit_contact`). Where E is K d, F is
K d - (c + h K) v_n'. MuJoCo's own contacts are made to take the same step of the normal, exactly, and friction that is
no softer (`soft_contact`; docs/decisions/contact.md has what that leaves).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.assets import asset
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.wall import vectors
from haustra.models.wall.elasticity import ELASTICITIES, LINEAR, Elasticity, linear, stiffest
from haustra.models.wall.vectors import Vector, dot, minus, times
from haustra.quantity import load_quantities

SLIP_SPEED = load_quantities(asset("numbers/contact.toml"))["contact.slip_speed"].value
"""v_s: friction is Coulomb's above this sliding speed and viscous below [m/s]."""

IMPEDANCE_RATIO = 100.0
"""Stiffness of friction over that of the normal (MuJoCo's impratio). Friction below Coulomb's limit is a damper of this
times (c + h K): at K = 1500 N/m and h = 5 ms contacts slip at no more than `SLIP_SPEED` up to mu F = 1.5 N."""

SLIP_RELAXATION = 0.3
"""Share of a slip that friction takes away in one step, where contacts are pairs. MuJoCo's cone presses a body that
slides at speed v harder, by mu (c + h K) v times this: at 1, K = 1500 N/m, h = 5 ms, mu = 0.1 and 0.1 m/s by 0.15 N.
Lower, a body comes to rest more slowly than by Coulomb's law: at 0.1 it stops up to 9 % late, at 0.3 within 1 %."""

_STILL = 1e-24
"""Keeps the derivative of no sliding finite; far less than any speed [m^2/s^2]."""

_IMPEDANCE_RANGE = (1e-4, 0.9999)
"""MuJoCo clamps impedance to this range (mjMINIMP, mjMAXIMP)."""


@dataclass(frozen=True)
class WallContact:
    """Stiffness, damping and friction between a device and the wall."""

    stiffness: float
    """Normal stiffness K of one contact at no depth [N/m]."""
    damping: float
    """Normal damping c of one contact [N s/m]."""
    friction: float
    """Coulomb coefficient mu [1]."""
    friction_rise: float = 0.0
    """Rise m of the coefficient with sliding speed, as on mucus [s/m]; MuJoCo's contacts have none of their own."""
    elasticity: str = LINEAR
    """Name of the law by which force grows with depth; MuJoCo's contacts have the linear one of their own."""

    def __post_init__(self) -> None:
        for name in ("stiffness", "damping"):
            value = getattr(self, name)
            if not 0 < value < 1e9:
                raise InvalidOptionError(f"Wall {name} is {value}; it must be positive and below 1e9.")
        if not 0 <= self.friction <= 5:
            raise InvalidOptionError(f"Friction is {self.friction}; it must be between 0 and 5.")
        if not 0 <= self.friction_rise < 1e3:
            raise InvalidOptionError(f"Friction rises by {self.friction_rise} s/m; it must be from 0 to below 1000.")
        if self.elasticity not in ELASTICITIES:
            raise InvalidOptionError(f"Elasticity '{self.elasticity}' is not known. Known: {', '.join(ELASTICITIES)}.")

    @property
    def rubs(self) -> bool:
        """Whether there is friction."""
        return self.friction > 0 or self.friction_rise > 0

    def stiffened(self, stiffness: float) -> "WallContact":
        """Return this law at another stiffness [N/m]; it relaxes in the same time."""
        return replace(self, stiffness=stiffness, damping=self.damping * stiffness / self.stiffness)


class ImplicitContact(NamedTuple):
    """One step of the law, for any places: numbers, or arrays of numpy or JAX."""

    inwards: Any
    """(..., 3) normals n of the wall."""
    spring: Any
    """E where the wall is touched, else 0 [N]."""
    damper: Any
    """(tau + h) E' there, else 0 [N s/m]."""
    drag: Any
    """Friction over sliding speed [N s/m]."""

    def damping(self, xp: Any) -> Any:
        """Force over the surface's speed against the wall (..., 3, 3) [N s/m]."""
        across = self.inwards[..., :, None] * self.inwards[..., None, :]
        along = xp.eye(3, dtype=across.dtype) - across
        return self.damper[..., None, None] * across + self.drag[..., None, None] * along

    def force(self, xp: Any, speed: Any) -> Any:
        """Force on a surface that moves at that speed against the wall (..., 3) [N]."""
        return self.spring[..., None] * self.inwards - xp.einsum("...ij,...j->...i", self.damping(xp), speed)


def implicit_contact(
    xp: Any,
    depth: Any,
    inwards: Any,
    speed: Any,
    carried: Any,
    *,
    stiffness: Any,
    ahead: Any,
    friction: Any,
    friction_rise: Any = 0.0,
    elasticity: Elasticity = linear,
) -> ImplicitContact:
    """The law at the beginning of a step.

    Whether a place that leaves the wall will press at the step's end is not known at its beginning. One that pressed at
    the end of the last step is taken to: let go, light links fall back in the next step and chatter. Where it does not,
    the wall holds it for that one step by what its damper lacks.

    Args:
        xp: numpy or jax.numpy.
        depth: d (...) [m].
        inwards: normals of the wall (..., 3).
        speed: of the device's surface against the wall (..., 3) [m/s].
        carried: whether there was a force at the end of the last step (...).
        stiffness: K [N/m].
        ahead: tau + h [s].
        friction: mu [1].
        friction_rise: m [s/m].
        elasticity: E.
    """
    law = {"stiffness": stiffness, "ahead": ahead, "friction": friction, "friction_rise": friction_rise}
    law["elasticity"] = elasticity
    spring, damper, drag = place_contact(xp, depth, vectors.of(inwards), vectors.of(speed), carried, **law)
    return ImplicitContact(inwards, spring, damper, drag)


def place_contact(
    xp: Any,
    depth: Any,
    inwards: Vector,
    speed: Vector,
    carried: Any,
    *,
    stiffness: Any,
    ahead: Any,
    friction: Any,
    friction_rise: Any = 0.0,
    elasticity: Elasticity = linear,
) -> tuple[Any, Any, Any]:
    """Spring [N], damper and drag [N s/m] of `ImplicitContact`, from vectors by their components."""
    depth, stiffness = elasticity(xp, depth, stiffness)
    damper, leaving = stiffness * ahead, dot(inwards, speed)
    pressing = (depth > 0) & (carried | (stiffness * depth > damper * leaving))
    spring, damper = xp.where(pressing, stiffness * depth, 0.0), xp.where(pressing, damper, 0.0)
    across = minus(speed, times(leaving, inwards))
    sliding = xp.sqrt(dot(across, across) + _STILL)
    coefficient = friction + friction_rise * sliding
    return spring, damper, coefficient * normal_force(xp, spring, damper, leaving) / xp.maximum(sliding, SLIP_SPEED)


def place_force(spring: Any, damper: Any, drag: Any, inwards: Vector, speed: Vector) -> Vector:
    """Force of `place_contact` on a surface that moves at that speed against the wall [N]."""
    along = spring - (damper - drag) * dot(inwards, speed)
    return minus(times(along, inwards), times(drag, speed))


def normal_force(xp: Any, spring: Any, damper: Any, leaving: Any) -> Any:
    """Normal force at the end of a step [N], of places that then leave the wall at that speed [m/s].

    Args:
        xp: numpy or jax.numpy.
        spring: E at the step's beginning, 0 where the wall was not touched [N].
        damper: (tau + h) E', of any value where it was not [N s/m].
        leaving: speed along the inward normal at the step's end [m/s].
    """
    return xp.where(spring > 0, xp.maximum(spring - damper * leaving, 0.0), 0.0)


class SoftContact(NamedTuple):
    """The law in MuJoCo's parameters, for any contacts: numbers, or arrays of numpy or JAX."""

    solref: Any
    """(..., 2) of the normal."""
    sliding: Any
    """(..., 2) solref of friction, which MuJoCo takes for pairs only."""
    impedance: Any
    """Both ends of solimp."""


def soft_contact(xp: Any, inverse_inertia: Any, stiffness: Any, damper: Any, *, timestep: Any) -> SoftContact:
    """Parameters with which MuJoCo's contact is F = K d + c d', integrated by backward Euler.

    MuJoCo's contact force is f = (-b v - k d r - a) / R with R = (1 - d) A / d, where A approximates the inverse
    inertia (`body_invweight0`), d is the impedance and a the acceleration in the contact. A backward Euler step of the
    spring and damper, F = -K (r + h v') - c v' with v' = v + h a, is the same expression when

        1/R = h (c + h K),   k d = K R,   b = (c + h K) R,

    which fixes the impedance, d = A / (A + R). The static stiffness is then exactly K, at any place along a chain and
    for any mass, and the contact is stable at any time step. Elliptic cones only: with pyramidal ones R also scales
    with friction.

    Args:
        xp: numpy or jax.numpy.
        inverse_inertia: `body_invweight0` [1/kg].
        stiffness: K [N/m].
        damper: c + h K [N s/m].
        timestep: h [s].
    """
    impedance, spring, loss, slip = soft_numbers(inverse_inertia, stiffness, damper, timestep)
    solref, sliding = xp.stack([spring, loss], axis=-1), xp.stack([xp.zeros_like(slip), slip], axis=-1)
    return SoftContact(solref, sliding, impedance)


def soft_numbers(inverse_inertia: Any, stiffness: Any, damper: Any, timestep: Any) -> tuple[Any, Any, Any, Any]:
    """What `soft_contact` is made of: impedance, both numbers of solref, and the second of friction's."""
    impedance = inverse_inertia / (inverse_inertia + 1 / (timestep * damper))
    scale = (1 - impedance) * inverse_inertia
    return impedance, -stiffness * scale, -damper * scale, -SLIP_RELAXATION * damper * scale


PARTS = (soft_numbers,)
"""What numba is to compile."""


def honoured_contact(inverse_inertia: Any, stiffness: Any, damper: Any, *, timestep: float, what: str) -> SoftContact:
    """`soft_contact` of a contact or stop, unless MuJoCo would clamp it, which would change its stiffness in silence.

    Raises:
        InvalidOptionError: naming what it is.
    """
    soft = soft_contact(np, np.asarray(inverse_inertia), stiffness, damper, timestep=timestep)
    low, high = _IMPEDANCE_RANGE
    if not ((soft.impedance > low) & (soft.impedance < high)).all():
        raise InvalidOptionError(
            f"{what} is outside what MuJoCo can honour at this time step: change the stiffness or the time step."
        )
    return soft


def contact_parameters(
    inverse_inertia: float | Float[np.ndarray, "*n"], contact: WallContact, *, timestep: float, where: str
) -> SoftContact:
    """MuJoCo's parameters that give bodies of that `body_invweight0` [1/kg] a law at no depth (`soft_contact`).

    Raises:
        InvalidOptionError: when MuJoCo would clamp the impedance, at no depth or where the law is stiffest; `where`
            names the place in the message.
    """
    damper = contact.damping + timestep * contact.stiffness
    _, soft = (
        honoured_contact(
            inverse_inertia,
            steeper * contact.stiffness,
            steeper * damper,
            timestep=timestep,
            what=f"Wall stiffness {steeper * contact.stiffness:g} N/m on '{where}'",
        )
        for steeper in (float(stiffest(contact.elasticity, 1.0)), 1.0)
    )
    return soft


def solimp(impedance: float) -> list[float]:
    """MuJoCo's solimp of a constant impedance: width, midpoint and power have no effect."""
    return [impedance, impedance, 0.001, 0.5, 2]


def require_impedance_ratio(spec: mujoco.MjSpec, ratio: float) -> None:
    """Let the scene's impratio be no less than a part asks for: it is one number, and its largest serves all.

    Friction that is stiffer than a part needs comes nearer to Coulomb's, at the price of the solver's iterations.
    """
    spec.option.impratio = max(spec.option.impratio, ratio)


def apply_contact(
    spec: mujoco.MjSpec, bare: mujoco.MjModel, geoms: Sequence[str], contact: WallContact, *, timestep: float
) -> None:
    """Give geoms of moving bodies the law, against all that they touch.

    Args:
        spec: the scene that holds the geoms.
        bare: the same moving bodies compiled at rest, for their inverse inertia; it need not hold the wall.
        geoms: names of geoms of moving bodies. They get priority over the wall's own parameters.
        contact: the law.
        timestep: the time step h it is integrated with [s].

    Raises:
        UnsupportedSceneError: when the law has what only walls have whose planes are placed before every step.
    """
    if contact.friction_rise or contact.elasticity != LINEAR:
        raise UnsupportedSceneError(
            "Friction that rises with speed and an elasticity that is not linear are not had by MuJoCo's contacts: "
            "leave friction_rise and elasticity out."
        )
    require_impedance_ratio(spec, IMPEDANCE_RATIO)
    for name in geoms:
        inverse_inertia = bare.body_invweight0[bare.geom_bodyid[bare.geom(name).id], 0]
        geom = spec.geom(name)
        soft = contact_parameters(inverse_inertia, contact, timestep=timestep, where=name)
        geom.solref, geom.solimp = soft.solref, solimp(float(soft.impedance))
        geom.friction = [contact.friction, 0.0, 0.0]
        geom.condim = 3 if contact.friction > 0 else 1
        geom.priority = 1
