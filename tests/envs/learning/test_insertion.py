"""A policy in a single run sees what the environments show, and its actions mean the same."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.learning.hands import PolicySettings
from haustra.envs.learning.insertion import run_policy
from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.tasks.config import Limits, Randomisation, TaskConfig
from haustra.envs.tasks.observation import flat, sizes
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import Scene, build_scene, entry_of
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.task_bank import DESIGN, short_bank

DECISIONS = 30
CERTAIN = Randomisation(
    friction=(0.05, 0.05),
    wall_stiffness=(1500.0, 1500.0),
    shaft_stiffness=(1.0, 1.0),
    wire_gain=(1.0, 1.0),
    wire_slack=(0.0, 0.0),
    start_roll=(0.0, 0.0),
)
CONFIG = TaskConfig(
    design=DESIGN, imager=True, memory=(0.5, 2.0), randomisation=CERTAIN, limits=Limits(seconds=0.04 * DECISIONS)
)
SETTINGS = PolicySettings("test", "", advance_rate=0.06, sampled=False)


def policy_of(config: TaskConfig) -> MlpPolicy:
    """Pushes, and bends and turns by a little of everything that it sees."""
    entries = sum(int(np.prod(shape)) for shape in sizes(config).values())
    weight = np.random.default_rng(3).normal(0.0, 0.02, (4, entries)).astype(np.float32)
    bias = np.array([0.6, 0.0, 0.1, 0.1], np.float32)
    return MlpPolicy((weight,), (bias,), activation="tanh", squashed=False, config=config)


@pytest.fixture(scope="module")
def scene() -> Scene:
    colon = swept_colon(winding([(0.08, 0.0), (0.08, 0.6), (0.12, 0.0)]), name="bend 0.6")
    options = replace(short_bank().options, friction=0.05, wall_stiffness=1500.0)
    return build_scene(colon, None, named_design(DESIGN), options)


def test_a_run_goes_as_the_episode_of_an_environment_does(scene: Scene) -> None:
    """What differs is precision: single in environments, double in runs."""
    policy = policy_of(CONFIG)
    task = ScopeTask(CONFIG, bank=short_bank(), backend="linear")
    seen, tips = task.reset(seeds=[0], case=0), []
    for _ in range(DECISIONS):
        seen = task.step(policy.act(flat(seen))).observation
        tips.append(task.seen.tip[0])
    task.close()
    run = run_policy(scene, policy, SETTINGS, seconds=0.04 * DECISIONS)
    assert run.trajectory.time[1::2] == pytest.approx(0.04 * np.arange(1, DECISIONS + 1))
    origin, axes = entry_of(scene.colon)
    np.testing.assert_allclose((run.trajectory.tip[1::2] - origin) @ axes, tips, atol=1e-4)
    assert np.linalg.norm(tips[-1] - tips[0]) > 0.03
    bent = np.hypot(run.trajectory.asked_up, run.trajectory.asked_left)
    assert bent.max() > 0.1 and run.settings == SETTINGS


def test_what_a_run_cannot_show_is_refused_by_name(scene: Scene) -> None:
    with pytest.raises(UnsupportedSceneError, match="privileged"):
        run_policy(scene, policy_of(replace(CONFIG, privileged=True)), SETTINGS, seconds=1.0)
    with pytest.raises(InvalidOptionError, match="whole number"):
        odd = replace(CONFIG, drive=replace(CONFIG.drive, control_interval=0.012))
        run_policy(scene, policy_of(odd), SETTINGS, seconds=1.0)
