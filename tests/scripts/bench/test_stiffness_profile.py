"""A profile by gradient: derivatives are those of the objective, and following them lowers it."""

import numpy as np
import pytest

from haustra.scripts.bench.linear import bank_of
from haustra.scripts.bench.stiffness_profile import ZONES, Problem, by_gradient, held_back, horizons


@pytest.fixture(scope="module")
def problem():
    return Problem(bank_of(40, colons=1), frictions=(0.08,), seconds=9.0)


def test_the_profile_keeps_its_mean_and_its_zones_share_out_the_shaft(problem):
    profile = problem.profile(np.linspace(-1, 1, ZONES))
    assert np.log(profile).mean() == pytest.approx(0.0, abs=1e-12)
    assert (np.sum(problem.zones, axis=0) <= 1).all()
    assert np.sum(problem.zones) > 0.5 * problem.plain.state().qpos.shape[1]


def test_derivatives_are_those_of_the_mean_force(problem):
    """Central differences over a millionth, along the steepest way."""
    nothing, step = np.zeros(ZONES), 1e-6
    forces, slopes, *_ = problem.sensitivity(nothing)
    np.testing.assert_allclose(forces, problem.value(nothing)[1], rtol=1e-7, atol=1e-8)
    steepest = slopes.mean(axis=(0, 1))
    steepest -= steepest.mean()
    way = steepest / np.linalg.norm(steepest)
    high, low = (problem.value(sign * step * way)[1].mean() for sign in (1, -1))
    assert steepest @ way == pytest.approx((high - low) / (2 * step), rel=1e-4)


def test_derivatives_hold_over_a_short_insertion(problem):
    (early,) = horizons(problem, [8.0])
    assert early.off_median < 0.1
    assert early.good == 1.0


@pytest.mark.thorough
def test_following_derivatives_lowers_the_force(problem):
    before, _ = problem.value(np.zeros(ZONES))
    found = by_gradient(problem, seconds=12.0)
    assert found.best[0] == pytest.approx(before, rel=1e-9)
    assert found.best[-1] < 0.97 * before
    assert found.best == sorted(found.best, reverse=True)


def test_what_is_held_back_is_no_longer_than_the_value():
    slopes = np.array([[3.0, 4.0], [0.3, 0.4]])
    np.testing.assert_allclose(held_back(np.array([1.0, 1.0]), slopes), [[0.6, 0.8], [0.3, 0.4]])
    assert not held_back(np.zeros(2), np.zeros((2, 2))).any()
