"""A heavy rod pushed through a horizontal tube: sinusoidal buckling at 2 sqrt(EI w/r), helical from 2.83 sqrt(EI w/r).

Sources: `haustra.scripts.bench.accuracy.tube`; contact force of a helix r F^2 / 4 EI: Lubinski et al., J. Petroleum
Technology 14 (1962) 655.
"""

import numpy as np
import pytest

from haustra.scripts.bench.accuracy.tube import CLEARANCE, EI, LENGTH, UNIT, TubeRod


@pytest.fixture(scope="module")
def rod():
    return TubeRod()


def test_it_buckles_sinusoidally_at_the_load_of_dawson_and_paslay(rod, compare):
    compare("tube: sinusoidal buckling load, Dawson and Paslay [N]", rod.sinusoidal_load(), 2 * UNIT, within=0.1)


def test_a_helix_presses_on_the_wall_as_lubinski_says(rod, compare):
    push = 12.0
    rod.chain.place(rod.data, rod.helix(push, weight=0.0))
    pushes, _ = rod.wall(rod.data.xpos[rod.bodies])
    middle = slice(rod.joints // 4, 3 * rod.joints // 4)
    inwards = CLEARANCE * np.array([1.0, 0.0]) - rod.data.xpos[rod.bodies][:, :2]
    assert (np.einsum("bi,bi->b", pushes[:, :2], inwards)[middle] > 0).all()
    per_length = np.linalg.norm(pushes[middle], axis=1).mean() * rod.joints / LENGTH
    compare("tube: contact force of a helix, Lubinski [N/m]", per_length, CLEARANCE * push**2 / (4 * EI), within=0.1)


def test_helix_and_straight_rod_have_equal_energy_at_the_load_of_chen(rod, compare):
    compare("tube: helical buckling load, Chen [N]", rod.helical_load(), np.sqrt(8) * UNIT, within=0.1)
