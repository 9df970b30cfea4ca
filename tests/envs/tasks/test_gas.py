"""Gas in episodes: each world has its own, drivers see the lumen as wide as gas holds it, and scores say how much."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from haustra.envs.learning.evaluate import evaluate
from haustra.envs.learning.hands import require_shown
from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.tasks.config import Limits, TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver, PushDriver
from haustra.envs.tasks.navigation import NavigationEnv
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.envs.tasks.vector import NavigationVectorEnv
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.gas.law import MMHG
from tests.task_bank import DESIGN, moving_bank, short_bank

CONFIG = TaskConfig(design=DESIGN, mesentery=True, gas=12 * MMHG, gas_start=12 * MMHG, limits=Limits(seconds=4.0))


def task_of(config: TaskConfig = CONFIG, **own: Any) -> ScopeTask:
    return ScopeTask(config, backend="linear", bank=moving_bank(), worlds=2, **own)


def test_drivers_see_a_lumen_as_wide_as_gas_holds_it():
    """At 12 mmHg narrower than as it was given, which is as at 25 mmHg."""
    seen = [
        task_of(config).reset(seeds=[0, 1], case=0)["lumen"]
        for config in (CONFIG, replace(CONFIG, gas=25 * MMHG, gas_start=3333.05))
    ]
    # Without gas, as numpy sees it: one program less.
    given = ScopeTask(replace(CONFIG, gas=None), backend="native", bank=moving_bank(), worlds=2)
    seen.append(given.reset(seeds=[0, 1], case=0)["lumen"])
    assert (seen[0].mean(axis=1) < 0.9 * seen[2].mean(axis=1)).all()
    np.testing.assert_allclose(seen[1], seen[2], atol=0.01)


def test_worlds_that_begin_anew_are_filled_anew():
    task = task_of()
    task.reset(seeds=[0, 1], case=0)
    gas = task.backend.gas
    assert gas is not None
    gas.asked = np.full(2, 5e-5)
    push = np.tile([1.0, 0, 0, 0], (2, 1))
    for _ in range(20):
        task.step(push)
    done = task.step(push)
    assert (done.info["gas_pressure_peak"] > 12.5 * MMHG).all() and (np.diff(done.info["gas_volume"]) == 0).all()
    gas.asked = np.full(2, np.nan)
    done = task.step(np.zeros((2, 4)), np.array([True, False]))
    assert done.info["gas_pressure_peak"][0] == pytest.approx(12 * MMHG, rel=0.02)
    assert done.info["gas_pressure_peak"][1] > 12.5 * MMHG
    assert done.info["gas_volume"][0] < done.info["gas_volume"][1]
    assert task.backend.read().time[0] == 0


def test_evaluations_say_pressure_and_volume_and_none_without_gas():
    found, usual = (
        evaluate(PushDriver, "push", config, moving_bank(), episodes=1, threads=1, backend="linear")
        for config in (CONFIG, replace(CONFIG, gas=None))
    )
    for one in found.episodes:
        assert 11.5 < float(one.gas_pressure_peak_mmHg or 0) < 13 and 20 < float(one.gas_volume_mL or 0) < 600
    assert usual.episodes[0].gas_volume_mL is usual.summary()["gas_pressure_peak_mmHg"] is None
    assert found.episodes[0].peak_force_N != usual.episodes[0].peak_force_N
    with pytest.raises(UnsupportedSceneError, match="record"):
        evaluate(PushDriver, "push", CONFIG, moving_bank(), backend="linear", record=True)


@pytest.mark.parametrize("backend", ["native", "linear-gpu"])
def test_other_backends_refuse_it_by_name(backend: str):
    with pytest.raises(UnsupportedSceneError, match=r"[Gg]as"):
        ScopeTask(CONFIG, backend=backend, bank=moving_bank())


def test_what_shows_colons_as_they_were_given_refuses_it():
    with pytest.raises(UnsupportedSceneError, match="as they were given"):
        task_of(replace(CONFIG, observation="depth"))
    with pytest.raises(UnsupportedSceneError, match="on_host"):
        task_of(on_host=True)
    with pytest.raises(UnsupportedSceneError, match="as they were given"):
        task_of().render(0, 16)
    with pytest.raises(InvalidOptionError, match="segments"):
        ScopeTask(replace(CONFIG, mesentery=False), backend="linear", bank=short_bank())


UNDER_WATER = replace(CONFIG, water=1e-4)


def test_water_fills_the_sigmoid_of_each_episode_and_weighs_on_it():
    """Poured in at the start, anew where a world begins anew; as heavy as in a scene of one scope."""
    task, dry = task_of(UNDER_WATER), task_of()
    for each in (task, dry):
        each.reset(seeds=[0, 1], case=0)
    gas = task.backend.gas
    assert gas is not None and task.bank.options.water == 1e-4
    np.testing.assert_allclose(gas.water.sum(axis=1), 1e-4)
    push = np.tile([1.0, 0, 0, 0], (2, 1))
    for _ in range(19):
        task.step(push)
        dry.step(push)
    done, other = task.step(push), dry.step(push)
    np.testing.assert_allclose(done.info["water_volume"], 1e-4)
    assert "water_volume" not in other.info
    assert (done.info["gas_volume"] < other.info["gas_volume"]).all()
    moved = [np.abs(each.displacement[..., :3]).max() for each in (task, dry) if each.displacement is not None]
    assert len(moved) == 2 and moved[0] != moved[1]
    anew = task.step(push, np.array([True, False]))
    np.testing.assert_allclose(anew.info["water_volume"], 1e-4)


def test_water_wants_gas_and_room_and_linear():
    with pytest.raises(InvalidOptionError, match="Water takes the place of gas"):
        TaskConfig(water=1e-4)
    with pytest.raises(InvalidOptionError, match="rectum and sigmoid take"):
        task_of(replace(CONFIG, water=2e-3))
    for backend in ("native", "linear-gpu"):
        with pytest.raises(UnsupportedSceneError, match=r"Gas|water"):
            ScopeTask(UNDER_WATER, backend=backend, bank=moving_bank())


def test_environments_of_one_world_and_many_take_water():
    options: dict[str, Any] = {"config": UNDER_WATER, "bank": moving_bank(), "backend": "linear"}
    alone, many = NavigationEnv(**options), NavigationVectorEnv(2, **options)
    alone.reset(seed=7)
    many.reset(seed=7)
    one, both = alone.step(np.zeros(4))[4], many.step(np.zeros((2, 4)))[4]
    assert one["water_volume"] == pytest.approx(1e-4)
    np.testing.assert_allclose(both["water_volume"], 1e-4)


BY_HAND = replace(CONFIG, gas_action=True)
STILL, LET_IN, SUCK = np.zeros(5), np.array([0, 0, 0, 0, 1.0]), np.array([0, 0, 0, 0, -1.0])


def after(task: ScopeTask, action: np.ndarray, steps: int = 25) -> Any:
    """What comes of the same action for a second."""
    for _ in range(steps - 1):
        task.step(action)
    return task.step(action)


def test_an_action_lets_gas_in_and_sucks_it_out():
    """What comes in is the flow times the time, but for the last tenth of a second; the other world is left alone."""
    task = task_of(BY_HAND)
    before = task.reset(seeds=[0, 1], case=0)["gas"]
    np.testing.assert_allclose(before[:, 0], 12 * MMHG / 3000, rtol=0.02)
    gas = task.backend.gas
    assert gas is not None and before.shape == (2, 3) and before.dtype == np.float32
    done = after(task, np.stack([LET_IN, STILL]), 50)
    shown = done.observation["gas"]
    np.testing.assert_array_equal(shown[:, 2], [1.0, 0.0])
    assert shown[0, 0] > before[0, 0] + 0.01 and shown[0, 1] > before[0, 1] + 0.003
    assert shown[1, 1] == pytest.approx(before[1, 1], abs=0.002)
    np.testing.assert_allclose(shown[:, 1], 1e3 * done.info["gas_volume"], rtol=1e-6)
    np.testing.assert_allclose(gas.state.given, [BY_HAND.gas_flow * 2.0, 0.0], rtol=0.06, atol=1e-15)
    less = after(task, np.stack([SUCK, STILL]), 100).observation["gas"]
    assert less[0, 1] < shown[0, 1] - 0.005 and less[0, 0] < shown[0, 0] and less[0, 2] == -1.0


def test_gas_of_changing_actions_is_let_in_whole():
    """Gas moves ten times a second, actions come more often: what counts is what they asked for in between."""
    task = task_of(BY_HAND)
    task.reset(seeds=[0, 1], case=0)
    for turn in range(60):
        task.step(np.stack([LET_IN if turn % 3 == 0 else STILL, LET_IN / 3]))
    gas = task.backend.gas
    assert gas is not None
    np.testing.assert_allclose(gas.state.given[0], gas.state.given[1], rtol=1e-5)


def test_episodes_that_begin_anew_show_their_own_gas():
    task = task_of(BY_HAND)
    first = task.reset(seeds=[0, 1], case=0)["gas"]
    after(task, np.stack([LET_IN, LET_IN]))
    shown = task.step(np.stack([LET_IN, LET_IN]), np.array([True, False])).observation["gas"]
    np.testing.assert_array_equal(shown[0], first[0])
    assert shown[1, 1] > first[1, 1] and shown[1, 2] == 1.0


def test_an_action_that_is_no_number_loses_the_world():
    task = task_of(BY_HAND)
    task.reset(seeds=[0, 1], case=0)
    done = task.step(np.stack([np.array([0, 0, 0, 0, np.nan]), STILL]))
    np.testing.assert_array_equal(done.info["diverged"], [True, False])
    assert np.isfinite(done.observation["gas"]).all()


def test_drivers_leave_gas_to_the_insufflator():
    """The follower drives a task with a gas action as it drives one without, to rounding; and as much gas comes in."""
    found = []
    for config in (replace(CONFIG, gas=15 * MMHG), replace(BY_HAND, gas=15 * MMHG)):
        task = task_of(config)
        seen = task.reset(seeds=[0, 1], case=0)
        driver = FollowerDriver(task)
        driver.begin(np.ones(2, bool))
        for _ in range(40):
            seen = task.step(driver.act(seen)).observation
        found.append((seen["state"], task.info()["gas_volume"]))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-6)


def test_what_is_in_place_takes_gas_and_shows_it():
    """As the sampler of a training reads and writes them."""
    task, other = task_of(BY_HAND), task_of(BY_HAND)
    for each in (task, other):
        each.reset(seeds=[0, 1], case=0)
    own, action = task.in_place, np.stack([LET_IN, SUCK])
    assert own.action.shape == (2, 5)
    for _ in range(10):
        own.action[:] = action
        task.advance()
    seen = after(other, action, 10).observation
    np.testing.assert_array_equal(own.observation["gas"], seen["gas"])
    np.testing.assert_array_equal(own.observation["state"], seen["state"])


def test_environments_take_the_action_and_pass_their_checks():
    """Gymnasium's check; one world and many show the same gas of the same episode."""
    options: dict[str, Any] = {"config": BY_HAND, "bank": moving_bank(), "backend": "linear"}
    alone, many = NavigationEnv(**options), NavigationVectorEnv(2, **options)
    assert alone.action_space.shape == (5,) and many.action_space.shape == (2, 5)
    check_env(alone, skip_render_check=True)
    one, both = alone.reset(seed=7)[0], many.reset(seed=7)[0]
    for _ in range(10):
        one, both = alone.step(LET_IN)[0], many.step(np.stack([LET_IN, STILL]))[0]
    np.testing.assert_allclose(one["gas"], both["gas"][0], rtol=1e-5)
    assert many.observation_space.contains(both) and not np.array_equal(*both["gas"])


def test_stable_baselines3_takes_the_action():
    checks = pytest.importorskip("stable_baselines3.common.env_checker")
    from haustra.envs.tasks.sb3 import TaskVecEnv

    checks.check_env(NavigationEnv(config=BY_HAND, bank=moving_bank(), backend="linear"), skip_render_check=True)
    worlds = TaskVecEnv(task_of(BY_HAND), flat=True)
    worlds.reset()
    assert worlds.action_space.shape == (5,)
    seen: Any = worlds.step(np.zeros((2, 5)))[0]
    assert seen.shape[1:] == worlds.observation_space.shape


def test_a_gas_action_wants_gas_and_names_and_linear():
    with pytest.raises(InvalidOptionError, match="gas_action"):
        TaskConfig(gas_action=True)
    with pytest.raises(InvalidOptionError, match="'dict'"):
        task_of(replace(BY_HAND, observation="state"))
    for backend in ("native", "linear-gpu"):
        with pytest.raises(UnsupportedSceneError, match=r"[Gg]as"):
            ScopeTask(BY_HAND, backend=backend, bank=moving_bank())
    with pytest.raises(UnsupportedSceneError, match="sees gas"):
        require_shown(MlpPolicy((), (), "tanh", squashed=False, config=BY_HAND))


def test_evaluations_of_a_gas_action_say_pressure_and_volume():
    found = evaluate(PushDriver, "push", BY_HAND, moving_bank(), episodes=1, threads=1, backend="linear")
    assert 20 < found.summary()["gas_volume_mL"] < 600 and found.summary()["gas_pressure_peak_mmHg"] > 11.5
