"""Wires as springs: what wheels take up stretches them, and what they pull takes stretch away."""

from typing import Any

import numpy as np
import pytest

from haustra.envs.sim.physics.wires import sprung_pulls, wheel_pulls, yielded_pulls
from haustra.models.devices.scope.wires import arriving_pulls, passed_part

_WIRES = {"compliance": 1e-4, "limit": 60.0}


def test_travel_takes_up_slack_then_stretches_the_wire():
    stretch = np.array([0.001, 0.002, 0.003, 0.1]) - 0.002
    np.testing.assert_allclose(wheel_pulls(np, stretch, **_WIRES), [0, 0, 10, 60])


@pytest.mark.parametrize("losses", [(0.0, 0.0), (0.2, 0.0), (0.1, 0.3)])
def test_where_pulls_move_nothing_what_arrives_is_what_arrives_of_a_given_pull(losses):
    random = np.random.default_rng(0)
    stretch, before = random.uniform(-0.004, 0.01, (50, 4)), random.uniform(0, 40, (50, 4))
    friction, hysteresis = losses
    lost = {"friction": friction, "hysteresis": hysteresis, "sheath_angle": 2.0}
    found = yielded_pulls(np, before, stretch, 0.0, part=passed_part(np, **lost), **_WIRES)
    hand = wheel_pulls(np, stretch, **_WIRES)
    np.testing.assert_allclose(found, np.minimum(arriving_pulls(np, hand, before, **lost), 60.0), rtol=1e-14)


@pytest.mark.parametrize("part", [1.0, 0.6])
@pytest.mark.parametrize("give", [1e-6, 1e-4, 1e-2])
def test_a_pull_is_that_of_the_stretch_it_leaves(part, give):
    """T = clip(before, p H(T), H(T) / p), with H the pull at the wheels of what T leaves of the stretch."""
    random = np.random.default_rng(1)
    stretch, before = random.uniform(-0.02, 0.05, 500), random.uniform(0, 50, 500)
    found = yielded_pulls(np, before, stretch, give, part=part, **_WIRES)
    hand = wheel_pulls(np, stretch - give * found, **_WIRES)
    np.testing.assert_allclose(found, np.clip(before, part * hand, np.minimum(hand / part, 60.0)), atol=1e-9)
    assert {0.0, 60.0 * part} <= set(found.round(9)) or give > 1e-4


def test_taut_wires_are_stiffness_in_the_matrix():
    """Backward Euler of springs -k a a^T q: (A + h^2 k a a^T) x = tau - k a (a q + h a v), solved at once."""
    random = np.random.default_rng(2)
    h, count = 0.005, 6
    root, arms = random.normal(size=(count, count)), random.normal(size=(2, count))
    matrix, torque = root @ root.T + np.eye(count), random.normal(size=count)
    angles, speeds, taken = 1e-3 * random.normal(size=count), random.normal(size=count), np.array([0.02, -0.03])
    stiffness = 1 / _WIRES["compliance"]
    stiff = matrix + h * h * stiffness * arms.T @ arms
    pulled = torque - stiffness * arms.T @ (taken + arms @ (angles + h * speeds))
    moved = np.linalg.solve(matrix, arms.T)
    give = h * h * arms @ moved
    ends = taken + arms @ (angles + h * (speeds + h * np.linalg.solve(matrix, torque)))
    wires: dict[str, Any] = {"compliance": 1e-4, "limit": 1e6, "part": 1.0}
    pulls = sprung_pulls(np, [0.0] * 4, tuple(ends), (give[0, 0], give[0, 1], give[1, 1]), slack=0.0, **wires)
    assert (np.array(pulls) > 0).tolist() == [True, False, False, True]
    found = np.linalg.solve(matrix, torque - arms.T @ np.array([pulls[0] - pulls[2], pulls[1] - pulls[3]]))
    np.testing.assert_allclose(found, np.linalg.solve(stiff, pulled), rtol=1e-10)
