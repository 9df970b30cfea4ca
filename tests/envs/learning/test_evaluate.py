"""The protocol: the same episodes for all drivers, intervals that cover, reasons for what failed."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.learning.drivers import PolicyDriver
from haustra.envs.learning.evaluate import evaluate
from haustra.envs.learning.policy import SHIPPED_POLICIES, load_policy, policy_folder
from haustra.envs.learning.statistics import bootstrap, wilson
from haustra.envs.tasks.config import Limits, TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver, PushDriver
from haustra.envs.tasks.scope_task import ScopeTask
from tests.task_bank import DESIGN, short_bank, tip_arcs

CONFIG = TaskConfig(design=DESIGN, observation="state", limits=Limits(seconds=12.0))


def test_wilson_covers_as_often_as_it_says():
    assert wilson(8, 10) == pytest.approx((0.4902, 0.9433), abs=1e-3)  # Wilson 1927, worked by hand
    assert wilson(0, 0) == (0.0, 1.0)
    random = np.random.default_rng(0)
    for share in (0.5, 0.95):
        hits = random.binomial(80, share, 2000)
        covered = [low <= share <= high for low, high in (wilson(int(k), 80) for k in hits)]
        assert np.mean(covered) > 0.93


def test_bootstrap_takes_colons_as_what_varies():
    values = np.repeat(np.random.default_rng(0).normal(size=(30, 1)), 5, axis=1)  # episodes of a colon are the same
    low, high = bootstrap(values)
    assert high - low == pytest.approx(2 * 1.96 * values[:, 0].std() / np.sqrt(30), rel=0.15)


def test_all_drivers_get_the_same_episodes_in_any_order():
    few = evaluate(PushDriver, "push", CONFIG, short_bank(), episodes=2, threads=1, most_worlds=1)
    many = evaluate(FollowerDriver, "follower", CONFIG, short_bank(), episodes=2, threads=1)
    assert [(one.colon, one.seed, one.friction) for one in few.episodes] == [
        (one.colon, one.seed, one.friction) for one in many.episodes
    ]
    found = many.summary()
    assert found["completion"] == 1.0 and found["reasons"] == {"reached": 4}
    assert found["peak_force_N"] > 0 and found["seconds_when_reached"] < 12
    assert all(one.safe == (one.reached and one.peak_force_N <= 14.1) for one in many.episodes)
    assert all(0 <= one.tip_ahead_m < 0.02 for one in many.episodes), "a tube without loops allows no short cut"


def test_both_backends_give_the_same_table():
    """The follower in two tubes: the same episodes, all completed, ways and times within a tenth, peaks within half."""
    found = [
        evaluate(FollowerDriver, "follower", CONFIG, short_bank(), episodes=2, backend=backend, record=True)
        for backend in ("native", "linear")
    ]
    ours, theirs = (one.summary() for one in found)
    assert ours.keys() == theirs.keys()
    assert [(a.colon, a.seed, a.friction) for a in found[0].episodes] == [
        (b.colon, b.seed, b.friction) for b in found[1].episodes
    ]
    assert ours["reasons"] == theirs["reasons"]
    assert ours["progress"] == pytest.approx(theirs["progress"], abs=0.02)
    assert ours["seconds_when_reached"] == pytest.approx(theirs["seconds_when_reached"], rel=0.1)
    for name in ("peak_force_N", "mean_force_N"):
        assert ours[name] == pytest.approx(theirs[name], rel=0.5)
    for one in found:
        kept = one.recording
        assert kept is not None and tip_arcs(kept) == pytest.approx(kept.tip_arc, abs=0.005)


def test_failures_are_named():
    short = replace(CONFIG, limits=Limits(seconds=1.0))
    found = evaluate(PushDriver, "push", short, short_bank(), episodes=1, threads=1).summary()
    assert found["completion"] == 0 and found["reasons"] == {"time up": 2}
    bank = short_bank()
    stub = replace(bank, options=replace(bank.options, insertion_limit=0.15))
    found = evaluate(PushDriver, "push", replace(CONFIG, limits=Limits(seconds=6.0)), stub, episodes=1, threads=1)
    assert found.summary()["reasons"] == {"fully inserted": 2}, "a scope of 19 cm in tubes of 28 cm"
    weak = replace(CONFIG, limits=Limits(seconds=12.0, perforation_force=0.2))
    found = evaluate(PushDriver, "push", weak, short_bank(), episodes=1, threads=1).summary()
    assert found["perforated"] == 1 and found["safe_completion"] == 0


@pytest.mark.parametrize("name", [name for name in SHIPPED_POLICIES if name.startswith("insertion")])
def test_shipped_policies_drive(name):
    """Through two short tubes that stand still; how far they come in colons is in docs/validation/navigation.md."""
    policy = load_policy(policy_folder(name))
    config = replace(policy.config, mesentery=False, limits=Limits(seconds=20.0))
    for sampled in (False, True) if policy.eyes is None else (True,):  # pictures take most of the time

        def driver(task: ScopeTask, sampled: bool = sampled) -> PolicyDriver:
            return PolicyDriver(policy, sampled=sampled)

        found = evaluate(driver, name, config, short_bank(), episodes=1, threads=1).summary()
        assert found["completion"] == 1.0
