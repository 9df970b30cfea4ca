"""Where mucosa bleeds."""

import math

import pytest

from haustra.models.injury.bleeding import bleeds, mucosal_shear
from haustra.models.injury.numbers import INJURY


def test_shear_is_friction_over_the_patch_that_a_link_lies_on() -> None:
    """0.1 x 13 N over pi/4 x 12.8 mm squared: 10.1 kPa; of half the load on half the link it is as much."""
    assert mucosal_shear(13.0, 0.1, 0.0128, 0.0) == pytest.approx(1.3 / (math.pi / 4 * 0.0128**2))
    long, short = mucosal_shear(8.0, 0.1, 0.001, 0.1), mucosal_shear(4.0, 0.1, 0.001, 0.05)
    assert long == pytest.approx(short, rel=0.02)


def test_a_threshold_parts_what_bleeds() -> None:
    threshold = INJURY["injury.bleeding_shear"].value
    assert bleeds(1.01 * threshold) and not bleeds(0.99 * threshold)
