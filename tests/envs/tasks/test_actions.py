"""Actions become what hands ask for."""

import numpy as np

from haustra.envs.tasks.actions import Wires, asked, within
from haustra.envs.tasks.config import Drive

DRIVE = Drive()


def ask(action, *, wheels=(0.0, 0.0), slack=0.0, lead=0.0, outside=1.0):
    parts = tuple(np.atleast_2d(np.asarray(action, float)).T)
    sound, taken = within(np, parts)
    wires = Wires(gain=0.9, slack=slack, limit=20.0)
    return asked(np, DRIVE, 0.04, taken, sound, wheels, wires, lead=np.array([lead]), outside=np.array([outside]))


def test_wheels_turn_no_faster_than_they_can_and_their_slack_does_nothing():
    one = ask([0, 0, 1, -1])
    np.testing.assert_allclose(one.wheels, [[0.16], [-0.16]])
    np.testing.assert_allclose(np.ravel(one.pulls), [0.16 * 0.9 * 20, 0, 0, 0.16 * 0.9 * 20])
    assert not np.any(ask([0, 0, 1, -1], slack=0.2).pulls)
    full = ask([0, 0, 1, 0], wheels=(np.array([1.0]), np.array([0.0])), slack=0.2)
    np.testing.assert_allclose(np.ravel(full.pulls), [18.0, 0, 0, 0])


def test_a_hand_neither_leads_too_far_nor_pushes_in_more_than_is_left():
    assert ask([1, 0, 0, 0]).push_rate == DRIVE.push_rate
    np.testing.assert_allclose(ask([1, 0, 0, 0], lead=DRIVE.hand_lead - 1e-3).push_rate, 1e-3 / 0.04)
    np.testing.assert_allclose(ask([1, 0, 0, 0], outside=5e-4).push_rate, 5e-4 / 0.04)
    np.testing.assert_allclose(ask([-1, 0, 0, 0], lead=1e-3 - DRIVE.hand_lead).push_rate, -1e-3 / 0.04)


def test_what_is_no_action_is_told_by_a_push_that_is_no_number():
    for bad in (np.nan, np.inf, -np.inf):
        one = ask([0.5, bad, 0.0, 0.0])
        assert np.isnan(one.push_rate).all() and np.all(one.roll_rate == 0)
    np.testing.assert_array_equal(ask([1e300, 0, 0, 0]).push_rate, DRIVE.push_rate)
