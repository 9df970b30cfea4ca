"""Pull wires between the hand wheels and the bending section: what of a pull arrives, and what travel it takes.

A wire in a sheath that is bent through an angle theta loses tension by the capstan equation, T_out = T_in
exp(-mu theta); what arrives lags behind when the pull is eased, because the friction then acts the other way. Real used
scopes show both, and slack besides (Rozeboom 2016, Endosc Int Open 4:E466: 2 of 20 reached their specified angle).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.fields import number

WIRE_NAMES = ("up", "left", "down", "right")
"""Wires in order of their angle about the axis: 0, 90, 180, 270 degrees from the link's x axis."""


@dataclass(frozen=True)
class WireSet:
    """Four pull wires of the bending section, 90 degrees apart."""

    routing_radius: float = number("m", 1e-4, 0.025)
    """Distance of each wire from the axis [m]."""
    pull_limit: float = number("N", 0.01, 1e4)
    """Largest pull of one wire [N]."""
    friction: float = number("1", 0.0, 10.0, default=0.0)
    """Coulomb coefficient between wire and sheath [1]."""
    slack: float = number("m", 0.0, 0.1, default=0.0)
    """Length that a wheel takes up before a wire pulls [m]; counts where wheels steer."""
    compliance: float = number("m/N", 0.0, 0.01, default=0.0)
    """Stretch of a wire per newton of pull [m/N]; counts where wheels steer, not where pulls are given."""
    hysteresis: float = number("1", 0.0, 0.99, default=0.0)
    """Part of the pull that is lost to friction in the bending section itself, at any bend of the shaft [1]."""


def arriving_pulls(
    xp: Any,
    hand: Float[Any, "*worlds 4"],
    before: Float[Any, "*worlds 4"],
    *,
    friction: Any,
    hysteresis: Any,
    sheath_angle: Any,
) -> Float[Any, "*worlds 4"]:
    """Pull at the bending section when the hand pulls with `hand`, and `before` arrived until now [N].

    While the hand's pull changes little, the wire sticks in its sheath and nothing changes at its end; it slips when
    the ratio of both tensions leaves the band of the capstan equation, exp(-mu theta) to exp(mu theta).

    Args:
        xp: numpy or jax.numpy.
        hand: pull of each wire at the wheels [N].
        before: what arrived so far [N].
        friction: `WireSet.friction`; this and what follows are numbers, or one a world with a last axis of one.
        hysteresis: `WireSet.hysteresis`.
        sheath_angle: angle that the shaft is bent through between wheels and bending section, summed regardless of
            direction [rad].
    """
    part = passed_part(xp, friction=friction, hysteresis=hysteresis, sheath_angle=sheath_angle)
    return xp.clip(before, hand * part, hand / part)


def passed_part(xp: Any, *, friction: Any, hysteresis: Any, sheath_angle: Any) -> Any:
    """Part of a growing pull that arrives at the bending section [1]: the capstan equation, less the section's own."""
    return xp.exp(-friction * sheath_angle) * (1 - hysteresis)


def travel_of_wheels(wheels: Float[np.ndarray, "*worlds 2"]) -> Float[np.ndarray, "*worlds 4"]:
    """Travel of the four wires [m]: each wheel takes up one wire, up or left, and pays out the opposite one."""
    return np.concatenate([wheels, -wheels], axis=-1)
