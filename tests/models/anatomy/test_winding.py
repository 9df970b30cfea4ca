"""How often a surface winds around points, against a tube that is known."""

import numpy as np
import pytest

from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.winding import winding_numbers
from tests.tube_colon import straight_tube


def test_a_surface_winds_once_around_what_is_within_and_not_around_the_rest() -> None:
    lumen = straight_tube(0.3).lumen
    middle = lumen.vertices.mean(axis=0)
    span = np.ptp(lumen.vertices, axis=0)
    random = np.random.default_rng(0)
    within = middle + random.uniform(-0.3, 0.3, (20, 3)) * span
    without = middle + random.choice([-1, 1], (20, 3)) * random.uniform(0.6, 2.0, (20, 3)) * span
    assert winding_numbers(lumen, within) == pytest.approx(1.0, abs=1e-9)
    assert winding_numbers(lumen, without) == pytest.approx(0.0, abs=1e-9)


def test_a_surface_that_is_turned_inside_out_winds_the_other_way() -> None:
    lumen = straight_tube(0.3).lumen
    turned = Surface(lumen.vertices, lumen.faces[:, ::-1])
    assert winding_numbers(turned, lumen.vertices.mean(axis=0)[None]) == pytest.approx(-1.0, abs=1e-9)
    assert winding_numbers(lumen, np.zeros((0, 3))).shape == (0,)
