"""The tracked robot as an environment: Gymnasium's contract, its treads drive it, its bellows press."""

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from haustra.envs.tasks.tracked_navigation import TrackedNavigationEnv, TrackedRules
from haustra.errors import InvalidOptionError
from tests.ring_wall import bent_colon, ring_wall

RULES = TrackedRules(distance=0.02, start=(0.03, 0.032), friction=(0.4, 0.4), seconds=3.0, force_weight=0.0)
FORWARD = np.array([1.0] * 4 + [0.0] * 4)


@pytest.fixture(scope="module")
def environment() -> TrackedNavigationEnv:
    colon = bent_colon(bend=0.06, length=0.3)
    return TrackedNavigationEnv(colon, ring_wall(colon), rules=RULES)


def test_gymnasium_and_stable_baselines_check_it(environment):
    check_env(environment, skip_render_check=True)
    pytest.importorskip("stable_baselines3.common.env_checker").check_env(environment)


def test_its_treads_drive_it_and_bellows_press(environment):
    pressed = {}
    for bellows in (-1.0, 1.0):
        environment.reset(seed=0)
        total, forces, done, info = 0.0, [], False, {}
        for _ in range(150):
            _, reward, done, late, info = environment.step([*FORWARD[:4], *[bellows] * 4])
            total += reward
            forces.append(info["wall_force"])
            if done or late:
                break
        pressed[bellows] = np.mean(forces[10:])
    assert done and info["reached"] and total == pytest.approx(100, abs=25)
    assert pressed[1.0] > 1.2 * pressed[-1.0]


def test_options_that_cannot_be_honoured_are_named(environment):
    with pytest.raises(InvalidOptionError, match="pictures"):
        TrackedNavigationEnv(environment._colon, environment._wall, render_mode="human")
    with pytest.raises(InvalidOptionError, match="fit"):
        TrackedNavigationEnv(environment._colon, environment._wall, rules=TrackedRules(start=(0.5, 9.0)))
