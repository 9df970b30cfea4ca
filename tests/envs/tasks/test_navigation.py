"""One scope as a Gymnasium environment: Gymnasium's and Stable-Baselines3's contracts, seeds, endings, pictures."""

import warnings
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import haustra.envs
from haustra.envs.sim.native_batch import NativeBackend
from haustra.envs.tasks.config import Limits
from haustra.envs.tasks.navigation import NavigationEnv
from haustra.errors import InvalidOptionError
from tests.task_bank import moving_bank, short_bank

MODES = [
    {"observation": "state"},
    # Both checkers see all other modes, too, in `test_calls.test_every_environment_keeps_its_contracts`.
    *(
        pytest.param(mode, marks=pytest.mark.thorough)
        for mode in (
            {"observation": "lumen"},
            {"observation": "depth", "picture_size": 36},
            {"observation": "pixels", "picture_size": 36},
            {"observation": "dict"},
            {"observation": "dict", "privileged": True, "depth": True, "pictures": True, "picture_size": 36},
        )
    ),
]
PUSH = np.array([1.0, 0.0, 0.0, 0.0], np.float32)


def make(**options) -> Any:
    assert haustra.envs
    return gymnasium.make("Haustra/Colonoscopy-v0", **{"bank": short_bank(), **options})


def checked_by_gymnasium(**options) -> None:
    environment = make(render_mode="rgb_array", **options)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*Not able to test alternative render modes.*")
        warnings.filterwarnings("ignore", message=".*render fps.*")
        check_env(environment.unwrapped)


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: "-".join(map(str, mode.values())))
def test_gymnasium_checks_every_mode(mode):
    checked_by_gymnasium(**mode)


def test_both_check_pictures_in_a_colon_that_moves():
    mode = {"observation": "pixels", "picture_size": 36, "mesentery": True, "bank": moving_bank()}
    checked_by_gymnasium(**mode)
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(NavigationEnv(**mode))


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: "-".join(map(str, mode.values())))
def test_stable_baselines_checks_every_mode(mode):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(NavigationEnv(bank=short_bank(), **mode))


def test_the_same_seed_is_the_same_episode_and_another_is_not():
    environment = make(observation="dict")

    def episode(seed: int) -> list[np.ndarray]:
        seen, _ = environment.reset(seed=seed)
        rows = [np.concatenate([seen["state"], seen["lumen"]])]
        for _ in range(20):
            seen, reward, *_ = environment.step(PUSH)
            rows.append(np.append(np.concatenate([seen["state"], seen["lumen"]]), float(reward)))
        return rows

    first, again, other = episode(3), episode(3), episode(4)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[-1], other[-1])


def test_an_episode_ends_in_the_caecum_and_pays_for_the_way():
    environment = make(observation="state", randomisation={"friction": [0.0, 0.0]})
    environment.reset(seed=0, options={"case": 0})
    total, last, terminated, truncated = 0.0, {}, False, False
    for _ in range(400):
        _, reward, terminated, truncated, last = environment.step(PUSH)
        total += reward
        if terminated or truncated:
            break
    assert terminated and not truncated
    assert last["reached"] and not last["perforated"] and not last["diverged"]
    assert last["progress"] == pytest.approx(1.0)
    assert 100 < total <= 120  # 100 for the way, 20 in the caecum, less time and forces


def test_time_truncates_and_a_wall_that_breaks_terminates():
    environment = NavigationEnv(bank=short_bank(), observation="state", limits={"seconds": 0.4})
    environment.reset(seed=0)
    ends = [environment.step(np.zeros(4))[2:4] for _ in range(10)]
    assert ends == [(False, False)] * 9 + [(False, True)]
    limits = Limits(perforation_force=0.2)
    weak = NavigationEnv(bank=short_bank(), observation="state", limits=vars(limits))
    weak.reset(seed=0)
    reward, info = 0.0, {}
    for _ in range(400):
        _, reward, terminated, _, info = weak.step(np.array([1.0, 0.0, 1.0, 0.0]))
        if terminated:
            break
    assert info["perforated"] and not info["reached"]
    # 0.2 N ends the episode by the rule that was given; nobody's colon is torn by it.
    assert 0 < info["perforation_arc"] <= info["tip_arc"] + 0.02 and info["p_perforation"] < 1e-6
    assert reward < -15


def test_a_diverged_world_terminates_with_its_own_flag():
    environment = NavigationEnv(bank=short_bank(), observation="state")
    environment.reset(seed=0)
    backend = environment.task.backend
    assert isinstance(backend, NativeBackend)
    backend._shards[0]._qvel[0, 3] = np.inf
    seen, reward, terminated, truncated, info = environment.step(PUSH)
    assert terminated and not truncated and info["diverged"]
    assert np.isfinite(seen).all() and reward == 0
    environment.reset()
    assert not environment.step(PUSH)[2]


def test_what_a_device_cannot_know_is_only_shown_when_asked_for():
    environment = make(observation="dict")
    assert set(environment.observation_space.spaces) == {"state", "lumen"}
    assert "privileged" in make(observation="dict", privileged=True).observation_space.spaces
    with pytest.raises(InvalidOptionError, match="dict"):
        make(observation="state", privileged=True)


def test_depth_falls_towards_a_wall_and_pictures_have_their_shape():
    environment = make(render_mode="depth_array", observation="state")
    environment.reset(seed=0, options={"case": 0})
    depth = np.asarray(environment.render())
    middle = depth.shape[0] // 2
    assert depth[middle, middle] > depth[middle, 20] > 0.005  # ahead is deep, beside is the wall at 20 mm
    assert depth[0, 0] == 0
    environment = make(render_mode="rgb_array", observation="state")
    environment.reset(seed=0)
    assert environment.render().shape == (240, 240, 3)


def test_wrong_options_are_named():
    wrong: tuple[tuple[dict[str, Any], str], ...] = (
        ({"observation": "smell"}, "smell"),
        ({"wheels": 3}, "wheels"),
        ({"render_mode": "x"}, "x"),
    )
    for options, word in wrong:
        with pytest.raises(InvalidOptionError, match=word):
            NavigationEnv(bank=short_bank(), **options)
