"""The share of people whose colon is torn, against the lognormal distribution and the numbers it is made of."""

import math

import numpy as np
import pytest

from haustra.models.injury.numbers import INJURY
from haustra.models.injury.perforation import (
    SIGMA,
    TORN,
    Strength,
    bursting_pressure,
    gas_load,
    head_strength,
    link_load,
    perforation_probability,
    worst_load,
)

HUMAN = INJURY["injury.human_over_porcine"].value
USUAL = INJURY["injury.head_diameter"].value


def test_strength_is_that_of_the_heads_that_were_tested() -> None:
    """Johnson 2019: 14.1 N under a straight head, 46.5 N under one bent by 90 degrees, times human over porcine."""
    bends = np.radians([0.0, 45.0, 90.0, 180.0, 300.0])
    np.testing.assert_allclose(head_strength(np, bends) / HUMAN, [14.1, 30.3, 46.5, 25.6, 25.6])


def test_half_of_people_are_torn_at_the_median_and_the_spread_is_the_published_one() -> None:
    """A lognormal strength of median S and sigma^2 = ln(1 + CV^2) has that coefficient of variation."""
    assert perforation_probability(1.0) == pytest.approx(0.5)
    strengths = np.exp(SIGMA * np.random.default_rng(0).standard_normal(400_000))
    assert strengths.std() / strengths.mean() == pytest.approx(INJURY["injury.between_persons"].value, rel=0.01)
    loads = np.array([0.6, 0.8, 1.3])
    drawn = [(strengths < load).mean() for load in loads]
    np.testing.assert_allclose(perforation_probability(loads), drawn, atol=3e-3)


def test_nothing_is_torn_by_nothing_and_everybody_by_an_escape() -> None:
    assert perforation_probability(0.0) == 0.0
    assert perforation_probability(TORN) == 1.0
    assert np.all(np.diff(perforation_probability(np.linspace(0.1, 3.0, 50))) > 0)


def test_one_factor_a_person_makes_the_largest_ratio_all_that_counts() -> None:
    """P(any place torn) over people, drawn, is that of the largest load: no other correlation is assumed."""
    loads = np.random.default_rng(1).uniform(0.2, 0.9, 200)
    factors = np.exp(SIGMA * np.random.default_rng(2).standard_normal(100_000))
    drawn = (loads[None, :] > factors[:, None]).any(axis=1).mean()
    assert perforation_probability(loads.max()) == pytest.approx(drawn, abs=4e-3)


def test_a_thicker_device_needs_more_force_and_a_shaft_lies_sideways() -> None:
    force, straight = np.full(3, 10.0), 0.0
    diameters = USUAL * np.array([0.5, 1.0, 2.0])
    loads = link_load(np, force, straight, True, diameters)
    np.testing.assert_allclose(loads, 10.0 / (HUMAN * 14.1 * np.array([0.75, 1.0, 1.5])))
    assert link_load(np, 10.0, straight, False, USUAL) == pytest.approx(10.0 / (HUMAN * 25.6))


def test_a_wall_of_other_numbers_bears_what_they_say() -> None:
    """Each number of a patient's own where the file's stands otherwise: shape, size, and length of a contact."""
    weaker = Strength.of({"strength.sideways": 12.8, "size_share": 1.0, "head_diameter": USUAL / 2})
    assert link_load(np, 10.0, 0.0, False, USUAL, weaker) == pytest.approx(10.0 / (HUMAN * 12.8 * 2.0))
    assert head_strength(np, np.pi / 2, Strength.of({"strength.bent": 20.0})) == pytest.approx(HUMAN * 20.0)
    assert Strength.of({"contact_length": 0.05}).contact_length == 0.05
    assert Strength.of({}) == Strength.of()


def test_gas_bursts_half_of_caeca_at_81_mmHg() -> None:
    """169 mmHg in the sigmoid, 81 in the caecum, of human cadavers; an unknown segment is taken for the weakest."""
    torr = 133.322
    assert bursting_pressure("caecum") == bursting_pressure("elsewhere") == pytest.approx(81 * torr, abs=1)
    assert bursting_pressure("sigmoid") == pytest.approx(169 * torr, abs=1)
    pressures = np.array([81.0, -5.0]) * torr
    np.testing.assert_allclose(gas_load(pressures, np.full(2, bursting_pressure("caecum"))), [1.0, 0.0], atol=1e-4)


def test_the_worst_load_keeps_where_it_was_and_an_escape_is_a_tear() -> None:
    worst = (np.zeros(3), np.zeros(3))
    for load, arc in ((0.4, 0.1), (0.7, 0.2), (0.5, 0.3)):
        worst = worst_load(np, worst, np.full(3, load), np.full(3, arc), np.zeros(3, bool))
    np.testing.assert_allclose(worst, [[0.7] * 3, [0.2] * 3])
    now = np.array([0.6, 0.6, 0.0])
    load, arc = worst_load(np, worst, now, np.full(3, 0.4), np.array([False, True, True]))
    np.testing.assert_allclose(load, [0.7, TORN, TORN])
    np.testing.assert_allclose(arc, [0.2, 0.4, 0.2])
    assert math.isfinite(load.max())
