"""Where mucosa bleeds: a place does that is sheared by more than a threshold, which is assumed.

A link of length L that slides under the force F shears the mucosa by friction over the patch it lies on
(`haustra.models.injury.patch`),

    tau = mu F / (pi d^2 / 4 + d L).

Whether it slides is not asked, so this is a bound. Nobody has published what mucosa stands; the threshold and its range
are an engineering choice (`injury.bleeding_shear`).
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


def wound_area(width: float) -> float:
    """Raw surface of a round wound that an instrument has cut [m^2]; all of it is taken to bleed, until it is treated.

    Args:
        width: of the wound [m].
    """
    return math.pi / 4 * width**2
