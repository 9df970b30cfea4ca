"""Episodes in one program: what numpy works out, episode by episode, with beginnings in between."""

from inspect import unwrap
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.tasks.config import Limits, TaskConfig, Weights
from haustra.envs.tasks.episode_program import IN_PROGRAM
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.envs.tasks.vector import NavigationVectorEnv
from haustra.errors import UnsupportedSceneError
from tests.task_bank import DESIGN, moving_bank, short_bank

WORLDS = 5
EVERYTHING = TaskConfig(
    design=DESIGN,
    imager=True,
    privileged=True,
    memory=(0.5, 2.0),
    weights=Weights(advance=50.0, facing=1.0, looping=1.0),
    limits=Limits(seconds=2.0),
)


def make(config: TaskConfig = EVERYTHING, **own: Any) -> ScopeTask:
    return ScopeTask(config, **{"worlds": WORLDS, "threads": 2, "backend": "linear", "bank": short_bank()} | own)


def actions(steps: int, worlds: int = WORLDS) -> np.ndarray:
    """Pushes under changing tips, one that is no number, one beyond all bounds."""
    chosen = np.random.default_rng(1).uniform(-1, 1, (-(-steps // 10), worlds, 4))
    chosen[..., 0] = np.abs(chosen[..., 0])
    found = np.repeat(chosen, 10, axis=0)[:steps]
    found[steps // 3, 3, 1] = np.nan
    found[steps // 4, 0] = 1e300
    return found


def beside(config: TaskConfig, steps: int, **own: Any) -> tuple[dict[str, float], int]:
    """Largest differences between the program and numpy, by name, and how many episodes ended.

    Rays that graze a fold end on it or beyond: the largest difference of all but two of a hundred counts.
    """
    tasks = [make(config, on_host=on_host, **own) for on_host in (False, True)]
    worst: dict[str, float] = {}

    def compare(*pair: Any) -> None:
        one, other = pair
        assert one.keys() == other.keys()
        for name, values in one.items():
            assert np.shape(values) == np.shape(other[name])
            both = np.asarray(values, float), np.asarray(other[name], float)
            apart = np.abs(both[0] - both[1])
            found = np.quantile(apart, 0.98) if name == "lumen" else apart.max(initial=0.0)
            worst[name] = max(worst.get(name, 0.0), float(found))

    compare(*(task.reset(seeds=list(range(WORLDS))) for task in tasks))
    compare(*(task.info() for task in tasks))
    over, ended = np.zeros(WORLDS, bool), 0
    for number, action in enumerate(actions(steps)):
        done = [task.step(action, over) for task in tasks]
        compare(*(one.observation for one in done))
        compare(*({"reward": one.reward, **one.info} for one in done))
        over = done[1].terminated | done[1].truncated
        np.testing.assert_array_equal(done[0].terminated, done[1].terminated)
        np.testing.assert_array_equal(done[0].truncated, done[1].truncated)
        ended += int(over.sum())
        if number == steps // 2:
            compare(*(task.reset(np.array([1, 4])) for task in tasks))
            over[[1, 4]] = False
    for task in tasks:
        task.close()
    return worst, ended


@pytest.mark.parametrize("moves", [False, pytest.param(True, marks=pytest.mark.thorough)])
def test_a_program_makes_the_episodes_that_numpy_makes(monkeypatch, moves):
    """In double precision, to 1e-9 over a hundred steps of contact; observations are in single precision."""
    monkeypatch.setitem(unwrap(LinearBackend.__init__).__kwdefaults__, "real", np.float64)
    config = TaskConfig.from_json(EVERYTHING.to_json() | {"mesentery": moves})
    worst, ended = beside(config, 120, bank=moving_bank() if moves else short_bank())
    assert ended > WORLDS
    for name, most in worst.items():
        assert most < (1e-4 if name == "lumen" else 2e-6 if name in IN_PROGRAM else 1e-9), name


def test_and_in_single_precision_as_closely_as_contact_lets_it():
    worst, _ = beside(TaskConfig(design=DESIGN, observation="state", limits=Limits(seconds=1.0)), 60)
    assert worst["state"] < 2e-3
    assert worst["tip"] < 1e-4
    assert worst["reward"] < 2e-3


def test_a_world_that_begins_anew_does_not_stall_or_touch_the_others():
    """World 2 begins anew while the others act: to the bit as they would without it."""
    config = TaskConfig(design=DESIGN, observation="state")
    tasks, made = [make(config), make(config)], []
    for task in tasks:
        task.reset(seeds=list(range(WORLDS)))
    others = np.arange(WORLDS) != 2
    for number, action in enumerate(actions(30)):
        begins = np.arange(WORLDS) == 2 if number == 15 else None
        made = [tasks[0].step(action, begins), tasks[1].step(action)]
        np.testing.assert_array_equal(made[0].observation["state"][others], made[1].observation["state"][others])
        np.testing.assert_array_equal(made[0].reward[others], made[1].reward[others])
    assert made[0].info["time"][2] == pytest.approx(14 * 0.04)
    for task in tasks:
        task.close()


def test_actions_and_observations_can_stay_in_place():
    """What `step` gives, in arrays that stay the same from step to step, without being copied."""
    tasks = [make(), make()]
    for task in tasks:
        task.reset(seeds=list(range(WORLDS)))
    own, over = tasks[0].in_place, np.zeros(WORLDS, bool)
    assert set(own.observation) == set(IN_PROGRAM) - {"unseen", "gas"}
    for action in actions(70):
        own.action[:] = np.clip(action, -1e30, 1e30)
        found, done = tasks[0].advance(over), tasks[1].step(action, over)
        over = done.terminated | done.truncated
        np.testing.assert_array_equal(found, over)
        for name, part in own.observation.items():
            np.testing.assert_array_equal(part, done.observation[name])
        np.testing.assert_array_equal(own.reward[:, 0], done.reward.astype(np.float32))
        np.testing.assert_array_equal(own.terminated[:, 0] > 0, done.terminated)
        np.testing.assert_array_equal(own.truncated[:, 0] > 0, done.truncated)
    for task in tasks:
        task.close()


def test_what_has_no_program_says_so():
    for own in ({"backend": "native"}, {"on_host": True}):
        task = make(TaskConfig(observation="state"), **own)
        task.reset(seeds=list(range(WORLDS)))
        for call in (lambda task=task: task.in_place, task.advance):
            with pytest.raises(UnsupportedSceneError, match="use `step`"):
                call()
        task.close()


def test_a_vector_environment_begins_anew_at_the_next_step_and_repeats():
    def run() -> list[np.ndarray]:
        vector = NavigationVectorEnv(
            WORLDS, bank=short_bank(), observation="state", backend="linear", limits={"seconds": 0.4}
        )
        assert vector.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
        seen, _ = vector.reset(seed=3)
        rows = [seen]
        for number in range(25):
            seen, reward, ended, late, info = vector.step(np.tile([1.0, 0.3, 0.2, 0.0], (WORLDS, 1)))
            assert vector.observation_space.contains(seen)
            assert late.all() == (number % 11 == 9)
            if number % 11 == 10:
                assert (reward == 0).all() and not ended.any() and not late.any() and not info["_tip_arc"].any()
                np.testing.assert_allclose(seen[:, 9], 0.03, atol=1e-6)
            rows += [seen, reward, info["p_perforation"]]
        vector.close()
        return rows

    for one, other in zip(run(), run(), strict=True):
        np.testing.assert_array_equal(one, other)


def test_episodes_can_be_staggered():
    task = make(TaskConfig(design=DESIGN, observation="state", limits=Limits(seconds=0.4)))
    task.reset(seeds=list(range(WORLDS)))
    task.stagger(0)
    ages = np.random.default_rng(0).integers(0, 10, WORLDS)
    for number in range(1, 11):
        done = task.step(np.zeros((WORLDS, 4)))
        np.testing.assert_array_equal(done.truncated, ages + number >= 10)
    task.close()


def test_at_once_too():
    vector = NavigationVectorEnv(
        2, bank=short_bank(), observation="state", backend="linear", limits={"seconds": 0.2}, autoreset_mode="SameStep"
    )
    vector.reset(seed=0)
    push = np.tile([1.0, 0, 0, 0], (2, 1))
    for _ in range(4):
        vector.step(push)
    seen, _, _, late, info = vector.step(push)
    assert late.all() and info["final_info"]["time_up"].all()
    np.testing.assert_allclose(seen[:, 9], 0.03, atol=1e-6)
    assert info["final_obs"][0][9] > 0.031
    vector.close()


@pytest.mark.parametrize("on_host", [False, True])
def test_what_a_wall_bears_holds_from_an_episode_s_beginning(on_host):
    """World 0 began when walls bore little, and is torn; world 1 began when they bore all."""
    task = make(TaskConfig(design=DESIGN, observation="state"), worlds=2, on_host=on_host)
    task.reset(seeds=[0, 0])
    task.bears = 1e-3
    task.reset(np.array([0]), [0])
    task.bears = 1e4
    torn = np.zeros(2, bool)
    for _ in range(60):
        torn |= task.step(np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))).info["perforated"]
    task.close()
    assert torn.tolist() == [True, False]
