"""The patch of wall that a link lies on: as long as the link, as wide as the device, round at its ends.

A load that is spread along a shaft falls on links in proportion to their length, so that force over rim or area does
not depend on how finely the shaft is cut. A link that presses with one place only is taken to press with all of it.
"""

import math
from collections.abc import Sequence
from typing import Any

from haustra.models.injury.numbers import injury_number

CONTACT_LENGTH = injury_number("contact_length")
"""Length of shaft whose load counts as one contact [m]."""


def patch_rim(diameter: Any, length: Any) -> Any:
    """Rim of the patch [m], by diameter of the device and length of the link [m]."""
    return math.pi * diameter + 2 * length


def patch_area(diameter: Any, length: Any) -> Any:
    """Area of the patch [m^2]."""
    return math.pi / 4 * diameter**2 + diameter * length


def force_on_contact(
    xp: Any, force: Any, length: Any, beside: Sequence[tuple[Any, Any]], *, contact: Any = CONTACT_LENGTH
) -> Any:
    """Force of the wall on the contact in whose middle a link is [N], however finely the shaft is cut.

    A link that is shorter than a contact shares it with its neighbours, each with as much of its length as the contact
    reaches over it; what a longer link bears may bear on any part of it, and counts as a whole.

    Args:
        xp: numpy, jax.numpy, or what writes programs.
        force: on the link [N].
        length: of the link [m].
        beside: forces [N] and lengths [m] of its neighbours; those of no force and some length where there is none.
        contact: length of shaft whose load counts as one contact [m].
    """
    reach = xp.maximum(contact - length, 0.0) / 2
    for other, long in beside:
        force = force + other * xp.minimum(reach / long, 1.0)
    return force
