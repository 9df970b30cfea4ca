"""Derivatives of what is read off: finite differences, sums of parts, and what has none."""

from functools import cache

import numpy as np
import pytest

from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.gradients import Direction, Gradients
from haustra.envs.sim.scope_reading import read_chain
from haustra.envs.sim.state import Controls
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.scripts.bench.gradients import READINGS, agreement, random_script
from haustra.scripts.bench.linear import bank_of, conditions

WORLDS = 3


@cache
def _bank(mesentery=False):
    return bank_of(40, colons=1, mesentery=mesentery)


def rolled(directions, *, worlds=WORLDS, seconds=2.0, mesentery=False):
    bank = _bank(mesentery)
    scopes = Gradients(bank.scene, bank.tables, worlds=worlds, directions=directions)
    scopes.reset(np.zeros(worlds, int), conditions(bank, worlds))
    *_, last = scopes.rollout(random_script(worlds, seconds), 25)
    return last


@pytest.mark.parametrize("mesentery", [pytest.param(False, marks=pytest.mark.thorough), True])
def test_derivatives_are_those_of_central_differences(mesentery):
    """Exact for the discrete step; what is left is of the differences: 2e-7 was seen. With a thousandth of a parameter
    spheres begin and cease to touch on the way, so that differences are off by as much as the derivative."""
    for each in agreement(_bank(mesentery), worlds=4, seconds=2.5):
        assert each.error < 1e-6, each


def test_values_are_those_of_the_plain_program():
    bank = _bank()
    values, _ = rolled(3 * [Direction(friction=1.0)])  # as many as elsewhere, so that no program is made for one
    plain = LinearBackend(bank.scene, bank.tables, worlds=WORLDS, real=np.float64)
    plain.reset(np.arange(WORLDS), np.zeros(WORLDS, int), conditions(bank, WORLDS))
    for inputs in random_script(WORLDS, 2.0):
        plain.step(inputs, 25)
    for name in ("tip", "wall_force_sum", "push_force", "link_forces"):
        np.testing.assert_allclose(getattr(values, name), getattr(plain.read(), name), rtol=1e-8, atol=1e-9)


def test_the_stiffness_of_the_shaft_is_that_of_all_its_joints():
    """A derivative is linear in the direction: joint by joint or all at once, and twice along twice the direction."""
    shaft = read_chain(_bank().scene).scale == 1
    halves = [shaft & (np.cumsum(shaft) % 2 == part) for part in range(2)]
    parts = [Direction(joint_stiffness=half.astype(float)) for half in halves]
    _, found = rolled([*parts, Direction(shaft_stiffness=1.0), Direction(shaft_stiffness=2.0)])
    for name in ("tip", "wall_force_sum", "bend"):
        slopes = getattr(found, name)
        np.testing.assert_allclose(slopes[:, 0] + slopes[:, 1], slopes[:, 2], rtol=1e-9, atol=1e-14)
        np.testing.assert_allclose(2 * slopes[:, 2], slopes[:, 3], rtol=1e-9, atol=1e-14)
        assert np.abs(slopes[:, 2]).max() > 0


def test_what_the_hand_does_later_adds_up_to_what_it_does():
    early, late = range(10), range(10, 1000)
    parts = [Direction(push_rate=1.0, during=during) for during in (early, late)]
    _, found = rolled([*parts, Direction(push_rate=1.0)])
    for name in ("insertion", "tip", "push_force"):
        slopes = getattr(found, name)
        np.testing.assert_allclose(slopes[:, 0] + slopes[:, 1], slopes[:, 2], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.insertion[:, 2], 2.0, rtol=0.1)  # 2 s at 1 m/s more is 2 m further


def test_time_and_directions_of_nothing_have_no_derivative():
    _, found = rolled([Direction(), Direction(friction=1.0), Direction()])
    assert found.tip.shape == (WORLDS, 3, 3)
    assert not found.time.any()
    for name in READINGS[:-1]:
        assert not getattr(found, name)[:, [0, 2]].any()
    assert found.displacement is None


def test_a_world_that_breaks_keeps_its_derivatives_and_harms_no_other():
    bank, directions = _bank(), 3 * [Direction(push_rate=1.0)]
    scopes, twin = (Gradients(bank.scene, bank.tables, worlds=WORLDS, directions=directions) for _ in range(2))
    inputs = Controls(np.full(WORLDS, 0.05), np.zeros(WORLDS), np.tile([9.0, 3.0, 1.0, 1.0], (WORLDS, 1)))
    for each in (scopes, twin):
        each.step(inputs, 100)
    before = scopes.read()[1]
    broken = np.array([0.05, np.nan, 0.05])
    assert scopes.step(inputs._replace(push_rate=broken), 20).tolist() == [True, False, True]
    twin.step(inputs, 20)
    after, known = scopes.read()[1], twin.read()[1]
    np.testing.assert_array_equal(after.insertion[1], before.insertion[1])
    np.testing.assert_array_equal(after.tip[[0, 2]], known.tip[[0, 2]])


def test_what_makes_no_sense_is_refused_by_name():
    bank = _bank()
    with pytest.raises(InvalidOptionError, match="at least one"):
        Gradients(bank.scene, bank.tables, worlds=2, directions=[])
    with pytest.raises(InvalidOptionError, match="one number a joint"):
        Gradients(bank.scene, bank.tables, worlds=2, directions=[Direction(joint_stiffness=np.ones(3))])
    with pytest.raises(InvalidOptionError, match="on a CPU only"):
        LinearBackend(bank.scene, bank.tables, worlds=2, directions=1, device="cuda")
    moving = _bank(mesentery=True)
    own = moving.tables.mesentery
    assert own is not None
    touching = moving.tables._replace(mesentery=own._replace(touch=np.ones_like(own.touch)))
    with pytest.raises(UnsupportedSceneError, match=r"leave out scene\.abdomen\.loops_touch"):
        LinearBackend(moving.scene, touching, worlds=2, directions=1)
