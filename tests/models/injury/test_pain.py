"""Tensions of wall and mesentery, against sheets whose tension is known."""

import math

import numpy as np
import pytest

from haustra.models.anatomy.colon import ColonSegment
from haustra.models.injury.numbers import INJURY
from haustra.models.injury.pain import axis_tensions, pain, pressed_tension
from haustra.models.wall.mesentery import hang

RADIUS = 0.02
LENGTH = 0.4


@pytest.fixture(scope="module")
def own():
    """A straight colon, the middle of which hangs on a mesentery."""
    arcs = np.linspace(0.0, LENGTH, 81)
    points = np.column_stack([0 * arcs, 0 * arcs, arcs])
    segments = [ColonSegment("rectum", 0.0, 0.1), ColonSegment("sigmoid", 0.1, LENGTH)]
    return hang(points, arcs, np.full(81, RADIUS), segments)


def test_nothing_pulls_where_nothing_has_moved(own) -> None:
    wall, held = axis_tensions(np, own, np.zeros((1, *own.nodes.shape)), np.full(len(own.nodes), RADIUS))
    assert np.abs(wall).max() < 1e-9 and held.max() < 0.01


def test_a_taut_mesentery_pulls_by_its_stiffness_and_a_slack_one_hardly(own) -> None:
    """Shifted aside as a whole by d, a node on a slack s bears k (d - s) + support d a metre, the wall nothing."""
    aside = 0.09
    moved = np.zeros((1, *own.nodes.shape))
    moved[..., 0] = aside
    wall, held = axis_tensions(np, own, moved, np.full(len(own.nodes), RADIUS))
    middle = len(own.nodes) * 5 // 8
    stiffness, support = 7000.0, 100.0
    expected = stiffness * (aside - own.slack[middle]) + support * aside
    assert held[0, middle] == pytest.approx(expected, rel=1e-6)
    assert (held[0, own.slack == 0] == 0.0).all()
    assert np.abs(wall).max() < 1e-6
    moved[..., 0] = 0.02
    assert axis_tensions(np, own, moved, np.full(len(own.nodes), RADIUS))[1][0, middle] == pytest.approx(2.0, rel=1e-4)


def test_a_stretched_wall_bears_its_modulus_times_strain_and_thickness(own) -> None:
    """E t e a metre of circumference, of a thin tube; none where it is pleated."""
    strain = 0.1
    moved = (strain * own.nodes)[None]
    wall, _ = axis_tensions(np, own, moved, np.full(len(own.nodes), RADIUS))
    assert wall[0, -4] == pytest.approx(179e3 * 0.0026 * strain, rel=1e-6)
    assert np.abs(axis_tensions(np, own, -moved, np.full(len(own.nodes), RADIUS))[0]).max() == 0.0


def test_pain_is_the_tension_that_is_nearest_to_hurting() -> None:
    """20 to 70 mmHg hurt in a sigmoid of 34 to 38 mm: by Laplace's law its wall then bears what is in the range."""
    number = INJURY["injury.painful_wall_tension"]
    assert number.low == pytest.approx(20 * 133.3 * 0.017, rel=0.01)
    assert number.high == pytest.approx(70 * 133.3 * 0.019, rel=0.02)
    wall, mesentery = number.value, INJURY["injury.painful_mesentery_tension"].value
    found = pain(np, np.array([wall, 0.5 * wall, 0.0]), np.array([0.0, mesentery, 2 * mesentery]))
    np.testing.assert_allclose(found, [1.0, 1.0, 2.0])
    assert pressed_tension(4.0, 0.0128, 0.05) == pytest.approx(4.0 / (math.pi * 0.0128 + 0.1))
