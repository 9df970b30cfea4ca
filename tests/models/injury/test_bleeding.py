"""Where mucosa bleeds."""

import math

import numpy as np
import pytest

from haustra.models.injury.bleeding import bleeds, bleeds_pulled, mucosal_shear, suction_pull
from haustra.models.injury.numbers import INJURY


def test_shear_is_friction_over_the_patch_that_a_link_lies_on() -> None:
    """0.1 x 13 N over pi/4 x 12.8 mm squared: 10.1 kPa; of half the load on half the link it is as much."""
    assert mucosal_shear(13.0, 0.1, 0.0128, 0.0) == pytest.approx(1.3 / (math.pi / 4 * 0.0128**2))
    long, short = mucosal_shear(8.0, 0.1, 0.001, 0.1), mucosal_shear(4.0, 0.1, 0.001, 0.05)
    assert long == pytest.approx(short, rel=0.02)


def test_a_threshold_parts_what_bleeds() -> None:
    threshold = INJURY["injury.bleeding_shear"].value
    assert bleeds(1.01 * threshold) and not bleeds(0.99 * threshold)


def test_suction_pulls_by_the_pressure_across_mucosa_that_lies_over_the_channel() -> None:
    """60 kPa below the atmosphere in the channel, 2.5 kPa over it in the lumen; nothing pulls at a distance."""
    sealed = np.array([True, False, True])
    pull = suction_pull(np, np.array([60e3, 60e3, 0.0]), 2500.0, sealed)
    np.testing.assert_allclose(pull, [62.5e3, 0.0, 0.0])
    threshold = INJURY["injury.bleeding_pull"].value
    least = threshold - 2500.0
    assert not bleeds_pulled(suction_pull(np, 0.99 * least, 2500.0, sealed[0]))
    assert bleeds_pulled(suction_pull(np, 1.01 * least, 2500.0, sealed[0]))
