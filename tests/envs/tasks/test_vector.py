"""Many scopes at once: the same episodes as one by one, and autoreset as Gymnasium defines it."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import haustra.envs
from haustra.envs.tasks.navigation import NavigationEnv
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.envs.tasks.vector import NavigationVectorEnv
from haustra.errors import InvalidOptionError
from tests.task_bank import short_bank


def make(count: int = 3, **options) -> NavigationVectorEnv:
    return NavigationVectorEnv(count, bank=short_bank(), **({"observation": "state", "threads": 1} | options))


def test_each_world_is_the_single_environment_of_its_seed():
    together = make(3, threads=2)
    seen, _ = together.reset(seed=5)
    actions = np.random.default_rng(0).uniform(-1, 1, (20, 3, 4)).astype(np.float32)
    rows = [seen]
    for action in actions:
        seen, *_ = together.step(action)
        rows.append(seen)
    for world in range(3):
        single = NavigationEnv(bank=short_bank(), observation="state")
        alone = [single.reset(seed=5 + world)[0]]
        alone += [single.step(action[world])[0] for action in actions]
        assert np.array_equal(np.array(rows)[:, world], np.array(alone))


def test_make_vec_makes_it_and_spaces_fit():
    assert haustra.envs
    made = gymnasium.make_vec(
        "Haustra/Colonoscopy-v0", num_envs=2, vectorization_mode="vector_entry_point", bank=short_bank()
    )
    seen, _ = made.reset(seed=0)
    assert made.observation_space.contains(seen)
    seen, reward, terminated, truncated, info = made.step(made.action_space.sample())
    assert made.observation_space.contains(seen)
    assert reward.shape == terminated.shape == truncated.shape == info["tip_arc"].shape == (2,)
    made.close()


def test_an_episode_that_is_over_begins_anew_at_the_next_step():
    vector = make(2, limits={"seconds": 0.2})
    vector.reset(seed=0)
    push = np.tile([1.0, 0, 0, 0], (2, 1))
    for _ in range(4):
        _, _, _, truncated, _ = vector.step(push)
        assert not truncated.any()
    seen, _, _, truncated, _ = vector.step(push)
    assert truncated.all()
    begun, reward, terminated, truncated, info = vector.step(push)
    assert not truncated.any() and not terminated.any() and (reward == 0).all() and not info["_tip_arc"].any()
    assert (begun[:, 9] < seen[:, 9]).all()  # inserted less again
    assert begun[:, 9] == pytest.approx(0.03, abs=1e-6)


def test_or_at_once_with_the_last_observation_in_info():
    vector = make(2, limits={"seconds": 0.2}, autoreset_mode=AutoresetMode.SAME_STEP)
    vector.reset(seed=0)
    push = np.tile([1.0, 0, 0, 0], (2, 1))
    for _ in range(4):
        vector.step(push)
    seen, _, _, truncated, info = vector.step(push)
    assert truncated.all()
    assert seen[:, 9] == pytest.approx(0.03, abs=1e-6)
    assert info["final_obs"][0][9] > 0.031
    assert info["final_info"]["time_up"].all()


def test_or_never():
    vector = make(2, limits={"seconds": 0.04}, autoreset_mode=AutoresetMode.DISABLED)
    vector.reset(seed=0)
    vector.step(np.zeros((2, 4)))
    with pytest.raises(InvalidOptionError, match="reset"):
        vector.step(np.zeros((2, 4)))
    vector.reset(options={"reset_mask": np.array([True, True])})
    vector.step(np.zeros((2, 4)))


def test_stable_baselines_wrapper_resets_and_reports_episodes():
    pytest.importorskip("stable_baselines3")
    from haustra.envs.tasks.navigation import configured
    from haustra.envs.tasks.sb3 import TaskVecEnv

    config = configured(None, {"observation": "dict", "limits": {"seconds": 0.2}})
    wrapped = TaskVecEnv(ScopeTask(config, worlds=2, bank=short_bank()))
    wrapped.seed(0)
    seen: Any = wrapped.reset()
    assert seen["state"].shape == (2, 18)
    push = np.tile([1.0, 0, 0, 0], (2, 1))
    for _ in range(4):
        wrapped.step(push)
    seen, _, over, infos = wrapped.step(push)
    assert over.all() and infos[0]["TimeLimit.truncated"] and infos[0]["episode"]["l"] == 5
    assert infos[0]["terminal_observation"]["state"][9] > seen["state"][0, 9]
