"""What an episode is paid for: getting on, slipping back, looking where one goes."""

import numpy as np
import pytest

from haustra.envs.tasks.config import Drive, TaskConfig, Weights
from haustra.envs.tasks.drivers import FollowerDriver
from haustra.envs.tasks.scope_task import ScopeTask
from tests.task_bank import DESIGN, short_bank

_ALONG = Weights(progress=100.0, advance=100.0, facing=1.0, reached=0.0, time=0.0, wall_force=0.0, perforation=0.0)


def _paid(task: ScopeTask, action: list[float], steps: int) -> dict[str, float]:
    """Sums of each term over some steps of one action."""
    done = [task.step(np.array([action])).info for _ in range(steps)]
    return {name: sum(float(info[f"reward_{name}"][0]) for info in done) for name in ("progress", "advance", "facing")}


def test_slipping_back_costs_what_getting_on_paid():
    task = ScopeTask(TaskConfig(design=DESIGN, weights=_ALONG), worlds=1, bank=short_bank())
    task.reset(np.arange(1), [0], case=0)
    on = _paid(task, [1.0, 0.0, 0.0, 0.0], 25)
    assert on["advance"] == pytest.approx(on["progress"], abs=0.5)
    assert on["progress"] > 10.0
    back = _paid(task, [-1.0, 0.0, 0.0, 0.0], 20)
    assert back["progress"] < 2.0  # the hand's lead of the push before
    assert back["advance"] < -0.6 * on["advance"]
    task.close()


def test_a_tip_that_looks_back_pays_for_it():
    task = ScopeTask(TaskConfig(design=DESIGN, weights=_ALONG), worlds=1, bank=short_bank())
    task.reset(np.arange(1), [0], case=0)
    ahead = _paid(task, [0.5, 0.0, 0.0, 0.0], 20)
    assert -0.5 < ahead["facing"] <= 0.0
    aside = _paid(task, [0.0, 0.0, 1.0, 0.0], 50)
    assert aside["facing"] < 10 * ahead["facing"]
    assert aside["facing"] < -2.5
    task.close()


def test_what_is_paid_is_a_number_at_both_ends_of_the_colon():
    """Beyond its ends a centreline has no direction; what lies beyond the caecum is looked up at its end."""
    config = TaskConfig(design=DESIGN, weights=_ALONG, drive=Drive(push_rate=0.12))
    task = ScopeTask(config, worlds=1, bank=short_bank())
    seen, driver = task.reset(np.arange(1), [0], case=0), FollowerDriver(task)
    driver.begin(np.ones(1, bool))
    length, furthest = task.bank.lengths[0], 0.0
    for _ in range(180):
        inside = furthest < length - 0.05
        done = task.step(driver.act(seen) if inside else np.array([[1.0, 0.0, 0.0, 0.0]]))
        seen, furthest = done.observation, max(furthest, task.seen.tip_arc[0])
        assert np.isfinite(done.reward).all()
    assert furthest == pytest.approx(length)
    for _ in range(180):
        assert np.isfinite(task.step(np.array([[-1.0, 0.0, 0.0, 0.0]])).reward).all()
    assert task.seen.tip_arc[0] < 0.0
    task.close()
