"""Where mucosa bleeds: a place does that is sheared by more than a threshold, which is assumed.

A link that slides under the force F shears the mucosa by friction over a patch as large as the device's cross-section,

    tau = mu F / (pi d^2 / 4).

Whether it slides is not asked, so this is a bound. Nobody has published what mucosa stands; the threshold and its range
are an engineering choice (`injury.bleeding_shear`).
"""

import math
from typing import Any

from haustra.models.injury.numbers import injury_number

PATCH = 0.02
"""Length of colon that bleeds once, however often it is sheared [m]; engineering choice."""


def mucosal_shear(force: Any, friction: Any, diameter: Any) -> Any:
    """Shear of the mucosa under a link [Pa], by force [N], coefficient of friction [1] and diameter [m]."""
    return friction * force / (math.pi / 4 * diameter**2)


def bleeds(shear: Any) -> Any:
    """Whether mucosa that is sheared by so much [Pa] bleeds."""
    return shear > injury_number("bleeding_shear")
