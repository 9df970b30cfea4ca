"""Where mucosa bleeds: a place does that is sheared, or pulled at by suction, by more than a threshold, both assumed.

A link of length L that slides under the force F shears the mucosa by friction over the patch it lies on
(`haustra.models.injury.patch`),

    tau = mu F / (pi d^2 / 4 + d L).

Whether it slides is not asked, so this is a bound.

Mucosa that lies over the mouth of a channel in which a scope sucks is pulled at by the pressure difference across it,

    p = p_lumen + s,

one over and one below the pressure of the atmosphere. How far tissue gets into the channel, and how long it is held, is
not asked.

Nobody has published what mucosa stands; thresholds and their ranges are an engineering choice (`injury.bleeding_shear`,
`injury.bleeding_pull`).
"""

import math
from typing import Any

from haustra.models.injury.numbers import injury_number
from haustra.models.injury.patch import patch_area

PATCH = 0.02
"""Length of colon that bleeds once, however often it is sheared [m]; engineering choice."""


def mucosal_shear(force: Any, friction: Any, diameter: Any, length: Any) -> Any:
    """Shear of the mucosa under a link [Pa], by force [N], friction [1], and the link's diameter and length [m]."""
    return friction * force / patch_area(diameter, length)


def bleeds(shear: Any) -> Any:
    """Whether mucosa that is sheared by so much [Pa] bleeds."""
    return shear > injury_number("bleeding_shear")


def suction_pull(xp: Any, suction: Any, pressure: Any, sealed: Any) -> Any:
    """Pull of suction on the mucosa over a channel's mouth [Pa]; none where it does not lie over it.

    Args:
        xp: numpy, jax.numpy, or what writes programs.
        suction: pressure in the channel below that of the atmosphere [Pa]; 0 where the scope does not suck.
        pressure: of the lumen over that of the atmosphere [Pa].
        sealed: whether mucosa lies over the mouth.
    """
    return xp.where(sealed & (suction > 0), suction + pressure, 0.0)


def bleeds_pulled(pull: Any) -> Any:
    """Whether mucosa at which suction pulls by so much [Pa] bleeds."""
    return pull > injury_number("bleeding_pull")


def wound_area(width: float) -> float:
    """Raw surface of a round wound that an instrument has cut [m^2]; all of it is taken to bleed, until it is treated.

    Args:
        width: of the wound [m].
    """
    return math.pi / 4 * width**2
