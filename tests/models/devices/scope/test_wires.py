"""Friction, slack and stretch of pull wires. Source: the capstan (Euler-Eytelwein) equation."""

import numpy as np
import pytest

from haustra.models.devices.scope.wires import WireSet, arriving_pulls

PLAIN = WireSet(routing_radius=0.005, pull_limit=60.0)
RUBBING = WireSet(routing_radius=0.005, pull_limit=60.0, friction=0.2)


def arrive(wires: WireSet, hand: np.ndarray, before: np.ndarray, *, sheath_angle: float) -> np.ndarray:
    """What arrives of pulls through those wires."""
    losses = {"friction": wires.friction, "hysteresis": wires.hysteresis}
    return arriving_pulls(np, hand, before, **losses, sheath_angle=sheath_angle)


def test_without_friction_all_of_a_pull_arrives():
    hand = np.array([10.0, 0.0, 3.0, 0.0])
    np.testing.assert_array_equal(arrive(PLAIN, hand, np.ones(4), sheath_angle=7.0), hand)


@pytest.mark.parametrize("turns", [0.25, 0.5, 1.0, 2.0])
def test_a_growing_pull_loses_by_the_capstan_equation(turns):
    hand = np.array([10.0, 0.0, 0.0, 0.0])
    arrived = arrive(RUBBING, hand, np.zeros(4), sheath_angle=2 * np.pi * turns)
    assert arrived[0] == pytest.approx(10 * np.exp(-0.2 * 2 * np.pi * turns))


def test_an_easing_pull_lags_behind():
    """Pulled to 10 N and eased: nothing changes until the hand is below by the square of the capstan factor."""
    angle, factor = np.pi, np.exp(-0.2 * np.pi)
    arrived = arrive(RUBBING, np.full(4, 10.0), np.zeros(4), sheath_angle=angle)
    eased = arrive(RUBBING, np.full(4, 10.0 * factor**2 * 1.01), arrived, sheath_angle=angle)
    np.testing.assert_array_equal(eased, arrived)
    slipping = arrive(RUBBING, np.full(4, 1.0), eased, sheath_angle=angle)
    np.testing.assert_allclose(slipping, 1.0 / factor)
    np.testing.assert_allclose(arrive(RUBBING, np.zeros(4), slipping, sheath_angle=angle), 0.0)
