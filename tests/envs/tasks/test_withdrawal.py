"""Withdrawal: it begins in the caecum, what is seen is paid, and it ends at the anus."""

from functools import cache
from itertools import pairwise

import gymnasium
import numpy as np
import pytest

import haustra.envs
from haustra.envs.learning import policy
from haustra.envs.sim.conditions import Conditions, Snapshot
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.state import Controls
from haustra.envs.tasks import inserted, scope_task
from haustra.envs.tasks.config import Drive, TaskConfig, Weights
from haustra.envs.tasks.inspect_driver import InspectDriver
from haustra.envs.tasks.navigation import NavigationEnv
from haustra.envs.tasks.polyps import Polyps
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError
from tests.task_bank import DESIGN, moving_bank, short_bank


def test_a_withdrawal_sees_more_and_more_and_ends_at_the_anus(tmp_path, monkeypatch):
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path))
    assert haustra.envs
    made = gymnasium.make("Haustra/Withdrawal-v0", bank=short_bank(), observation="state").unwrapped
    assert isinstance(made, NavigationEnv) and made.config.weights.coverage == 100.0
    _, info = made.reset(seed=0, options={"case": 0})
    start = made.task.seen.tip_arc[0]
    assert start > 0.22
    covered, total, done = [], 0.0, False
    for _ in range(300):
        _, reward, done, _, info = made.step(np.array([-1.0, 0.0, 0.0, 0.0]))
        covered.append(info["coverage"])
        total += reward
        if done:
            break
    assert done and info["reached"] and info["tip_arc"] <= 0.04
    assert covered[-1] > covered[0] > 0.05
    assert total > 50 * (covered[-1] - covered[0])
    made.reset(seed=1, options={"case": 0})
    assert made.task.seen.tip_arc[0] == start


def test_a_program_withdraws_from_colons_that_move_as_numpy_does(monkeypatch):
    """Both begin where a scope was left, see the same cells, pay the same haste, and end at the anus."""
    bank = moving_bank()
    monkeypatch.setattr(scope_task, "inserted_starts", lambda *_, **__: pushed_in())
    weights = Weights(coverage=100.0, haste=1.0)
    drive = Drive(control_interval=0.2, push_rate=0.05)
    config = TaskConfig(design=DESIGN, mesentery=True, task="withdrawal", weights=weights, drive=drive)
    own = {"worlds": 2, "threads": 1, "backend": "linear", "bank": bank}
    tasks = [ScopeTask(config, **own, on_host=on_host) for on_host in (False, True)]
    for task in tasks:
        task.reset(seeds=[0, 1], case=np.arange(2))
        np.testing.assert_allclose(task.info()["tip_arc"], [start.arcs[-1] for start in pushed_in()], atol=0.02)
    before = tasks[0].info()["coverage"]
    pull, done = np.tile([-0.5, 0.0, 0.4, 0.0], (2, 1)), []
    for _ in range(100):
        done = [task.step(pull) for task in tasks]
        one, other = (step.info for step in done)
        np.testing.assert_allclose(one["coverage"], other["coverage"], atol=0.02)
        np.testing.assert_allclose(one["reward_haste"], other["reward_haste"], atol=0.02)
        if one["reached"].all():
            break
    one, other = done
    assert one.info["reached"].all() and one.terminated.all()
    assert (one.info["coverage"] > before + 0.2).all()
    assert (one.info["reward_haste"] < -0.5).all()
    np.testing.assert_allclose(one.observation["unseen"], other.observation["unseen"], atol=0.1)
    np.testing.assert_allclose(one.observation["unseen"][:, 0], one.info["coverage"], atol=1e-6)


@cache
def pushed_in() -> tuple[Snapshot, ...]:
    """Scopes that were pushed into two colons for three seconds."""
    bank = moving_bank()
    backend = LinearBackend(bank.scene, bank.tables, worlds=2)
    backend.reset(np.arange(2), np.arange(2), Conditions(np.full(2, 0.03), np.full(2, 1500.0), np.ones(2)))
    backend.step(Controls(np.full(2, 0.04), np.zeros(2), np.zeros((2, 4))), 600)
    return tuple(backend.snapshot(world) for world in range(2))


@cache
def withdrawing() -> ScopeTask:
    """Two scopes that were pushed in, on the way out."""
    config = TaskConfig(design=DESIGN, mesentery=True, task="withdrawal")
    return ScopeTask(config, worlds=2, threads=1, backend="linear", bank=moving_bank())


@pytest.fixture
def task(monkeypatch) -> ScopeTask:
    monkeypatch.setattr(scope_task, "inserted_starts", lambda *_, **__: pushed_in())
    return withdrawing()


def test_who_inspects_looks_to_where_nothing_was_seen_and_frees_what_is_stuck(task):
    seen = {name: np.array(part) for name, part in task.reset(seeds=[0, 1], case=np.arange(2)).items()}
    seen["lumen"][:, -2:], seen["state"][:, 11:14] = (0.0, 0.2), 0.0
    seen["unseen"] = np.tile(np.array([0.1, 0.5, 1.0, 0.0, 0.0], np.float32), (2, 1))
    driver = InspectDriver(task)
    driver.begin(np.ones(2, bool))
    first = settled(driver, seen)
    assert (first[:, 0] < 0).all() and (first[:, 2] > 0.4).all() and first[:, 3] == pytest.approx(0.12, abs=0.02)
    seen["state"][:, 4] = -1.0  # the hand pulls with 20 N
    tense = settled(driver, seen)
    assert (tense[:, 0] > 0).all(), "it gives way"
    assert tense[:, 2:] == pytest.approx(np.tile([0.0, 0.2], (2, 1)), abs=0.01), "and looks along the lumen"
    seen["state"][:, 11] = 0.5
    assert settled(driver, seen)[:, 2:] == pytest.approx(0.0, abs=0.01), "wheels are let go where the tip is pressed"
    seen["state"][:, [4, 11]] = 0.0
    stuck = np.array([driver.act(seen)[0] for _ in range(round(30 / task.interval))])
    pushed = stuck[stuck[:, 0] > 0]
    assert len(pushed) and np.abs(pushed[-1, 2:]).max() < 0.01, "it is pushed back, wheels let go"
    with pytest.raises(InvalidOptionError, match="withdraws"):
        InspectDriver(ScopeTask(TaskConfig(design=DESIGN, observation="state"), worlds=1, bank=short_bank()))


def test_a_routine_turns_the_tip_in_circles_whatever_was_seen(task):
    seen = {name: np.array(part) for name, part in task.reset(seeds=[0, 1], case=np.arange(2)).items()}
    seen["lumen"][:, -2:], seen["state"][:, [4, 11, 12, 13]] = 0.0, 0.0
    driver = InspectDriver(task, routine=True)
    driver.begin(np.ones(2, bool))
    settled(driver, seen)
    wheels = np.array([driver.act(seen)[0, 2:] for _ in range(round(6 / task.interval))])
    assert np.ptp(np.linalg.norm(wheels, axis=1)) < 0.02
    assert (wheels.max(axis=0) > 0.15).all() and (wheels.min(axis=0) < -0.15).all()


def settled(driver: InspectDriver, seen: dict) -> np.ndarray:
    """What it does after five seconds of the same."""
    return [driver.act(seen) for _ in range(125)][-1]


def test_scopes_lie_straight_and_off_the_pole_where_a_withdrawal_begins(tmp_path, monkeypatch):
    """A tip in the pole hooks it, and a shaft in loops takes the colon along: both are seen to before."""
    monkeypatch.setattr(inserted, "cache_folder", lambda: tmp_path)  # that of compiled programs stays
    bank, config = moving_bank(), TaskConfig(design=DESIGN, mesentery=True, task="withdrawal")
    task = ScopeTask(config, worlds=2, threads=1, backend="linear", bank=bank)
    task.reset(seeds=[0, 1], case=np.arange(2))
    begins = bank.lengths - task.seen.tip_arc
    assert (begins > 0.04).all() and (begins < 0.08).all()
    assert (task.seen.insertion < task.seen.tip_arc + 0.01).all() and (task.seen.push_force < 1.0).all()


def test_starts_are_made_anew_when_another_policy_brings_scopes_in(tmp_path, monkeypatch):
    """Starts that are kept are those of the policy that ships now."""
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path))
    config, made = TaskConfig(design=DESIGN, mesentery=True, task="withdrawal"), []
    monkeypatch.setattr(inserted, "_insert", lambda *_: made.append(1) or pushed_in())
    for weights, times in ((b"one", 1), (b"one", 1), (b"another", 2)):
        (tmp_path / policy.WEIGHTS).write_bytes(weights)
        monkeypatch.setattr(policy, "policy_folder", lambda name: tmp_path)
        assert len(inserted.inserted_starts(config, moving_bank(), "linear")) == 2
        assert len(made) == times


def test_polyps_are_found_on_the_way_out_and_not_through_walls(task):
    """They lie in the mucosa, six to nine millimetres wide; who passes by finds some, who has not looked finds none."""
    task.reset(seeds=[0, 1], case=np.arange(2))
    polyps = Polyps(task)
    for world in range(2):
        polyps.begin(world, world, seed=5)
    assert (polyps._size >= 0.006).all() and (polyps._size <= 0.009).all()
    for world, case in enumerate(task.bank.cases):
        away = np.linalg.norm(polyps._base[world, :, None] - case.points, axis=2).min(axis=1)
        assert (away > 0.8 * case.sight.min()).all() and (away < 1.2 * case.sight.max()).all()
    assert not polyps.found.any()
    pull = np.tile([-0.5, 0.0, 0.0, 0.0], (2, 1))
    for _ in range(round(6 / task.interval)):
        task.step(pull)
        polyps.look()
    passed = polyps._arc > task.seen.tip_arc[:, None] + 0.005
    assert polyps.found.any() and polyps.found.sum() < polyps.found.size
    ahead = polyps._arc < task.seen.tip_arc[:, None] - 0.03
    assert passed.any() and not (polyps.found & ahead).any(), "what lies behind the tip is not in view"


def test_a_withdrawal_through_a_colon_that_moves_is_seen_in_colour(monkeypatch):
    """Red mucosa all the way, another picture after each step."""
    monkeypatch.setattr(scope_task, "inserted_starts", lambda *_, **__: pushed_in())
    about = {"observation": "pixels", "picture_size": 36, "mesentery": True, "bank": moving_bank(), "backend": "linear"}
    made = gymnasium.make("Haustra/Withdrawal-v0", **about).unwrapped
    pictures = [made.reset(seed=0)[0]]
    for _ in range(5):
        pictures.append(made.step(np.array([-1.0, 0.0, 0.0, 0.0], np.float32))[0])
    assert all(each[..., 0].mean() > each[..., 2].mean() > 5 for each in pictures)
    assert all((one != other).any() for one, other in pairwise(pictures))
