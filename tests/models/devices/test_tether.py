"""What is trailed grows taut by weight, friction and bends."""

import numpy as np
import pytest

from haustra.envs.sim.device_native import bends_behind
from haustra.models.devices.base import BENDS
from haustra.models.devices.tether import tether_tension
from haustra.models.wall.lumen_table import lumen_table, stack
from tests.ring_wall import bent_colon
from tests.tube_colon import straight_tube

MU = 0.3


def bends(theta: float) -> np.ndarray:
    return np.linspace(0.0, theta, BENDS)[None]


@pytest.mark.parametrize("theta", [np.pi / 2, 2 * np.pi, 8 * np.pi])
def test_round_bends_it_is_a_capstan(theta):
    """T = T0 exp(mu theta)."""
    found = tether_tension(np, bends(theta), np.array([1.0]), friction=MU, held=0.5)
    np.testing.assert_allclose(found, 0.5 * np.exp(MU * theta), rtol=1e-12)


def test_its_weight_counts_where_it_lies():
    """T = w R (exp(mu theta) - 1) of a tether of weight w per length round a bend of radius R; straight, mu w s."""
    theta, radius, mass = 4 * np.pi, 0.1, 0.005
    weight = 9.81 * mass
    found = tether_tension(np, bends(theta), np.array([radius * theta]), friction=MU, mass_per_length=mass)
    np.testing.assert_allclose(found, weight * radius * (np.exp(MU * theta) - 1), rtol=3e-3)
    straight = tether_tension(np, bends(0.0), np.array([2.0]), friction=MU, mass_per_length=mass)
    np.testing.assert_allclose(straight, MU * weight * 2.0, rtol=1e-12)


def test_a_quarter_turn_of_a_lumen_is_a_quarter_turn_of_the_tether():
    """Within 3 % of the capstan's law behind a bend of 90 degrees; nothing in a straight lumen."""
    colon = bent_colon(bend=0.06, leg=0.1, length=0.1 + 0.06 * np.pi / 2 + 0.1)
    for one, theta in ((colon, np.pi / 2), (straight_tube(0.2), 0.0)):
        tables = stack([lumen_table(one, device_radius=0.0055).tables])
        turned = bends_behind(np, tables, np.zeros(1, int), np.array([one.centreline.length - 0.02]))
        assert turned.shape == (1, BENDS)
        drawn = tether_tension(np, turned, np.array([0.2]), friction=MU, held=1.0)
        np.testing.assert_allclose(drawn, np.exp(MU * theta), rtol=0.03)
