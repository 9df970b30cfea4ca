"""The patch of wall that a link lies on: as long as the link, as wide as the device, round at its ends.

A load that is spread along a shaft falls on links in proportion to their length, so that force over rim or area does
not depend on how finely the shaft is cut. A link that presses with one place only is taken to press with all of it.
"""

import math
from typing import Any


def patch_rim(diameter: Any, length: Any) -> Any:
    """Rim of the patch [m], by diameter of the device and length of the link [m]."""
    return math.pi * diameter + 2 * length


def patch_area(diameter: Any, length: Any) -> Any:
    """Area of the patch [m^2]."""
    return math.pi / 4 * diameter**2 + diameter * length
