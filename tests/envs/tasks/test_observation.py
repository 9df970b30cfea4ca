"""What a learner sees beside the moment: running means of what the device measured."""

import numpy as np
import pytest

from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.observation import IMAGER_SIZE, STATE, Memory, sizes
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError
from tests.task_bank import DESIGN, short_bank


def test_a_running_mean_forgets_by_1_over_e_in_its_time() -> None:
    interval, times = 0.01, (0.5, 2.0)
    memory = Memory(times, 2, len(STATE), interval)
    before, after = np.zeros((2, len(STATE))), np.ones((2, len(STATE)))
    memory.begin(np.arange(2), before)
    for _ in range(50):
        memory.add(after)
    left = memory.recent(after).reshape(2, len(times), len(STATE))
    np.testing.assert_allclose(left[:, 0], np.exp(-1), rtol=1e-4)
    np.testing.assert_allclose(left[:, 1], np.exp(-0.25), rtol=1e-4)


def test_a_world_that_begins_anew_remembers_nothing_and_its_neighbour_all() -> None:
    memory = Memory((1.0,), 2, len(STATE), 0.1)
    memory.begin(np.arange(2), np.zeros((2, len(STATE))))
    now = np.ones((2, len(STATE)))
    memory.begin(np.array([1]), now)
    left = memory.recent(now)
    assert np.all(left[0] == 1.0)
    assert np.all(left[1] == 0.0)


def test_memory_comes_under_its_own_name_only() -> None:
    assert sizes(TaskConfig(memory=(1.0, 5.0)))["recent"] == (2 * len(STATE),)
    assert sizes(TaskConfig(memory=(1.0,), imager=True))["recent"] == (len(STATE) + IMAGER_SIZE,)
    assert not {"recent", "imager"} & set(sizes(TaskConfig()))
    with pytest.raises(InvalidOptionError, match="names of their own"):
        sizes(TaskConfig(observation="state", memory=(1.0,)))
    with pytest.raises(InvalidOptionError, match="names of their own"):
        sizes(TaskConfig(observation="state", imager=True))
    with pytest.raises(InvalidOptionError, match=r"give 0\.01 to 600 s"):
        TaskConfig(memory=(0.0,))


def test_an_imager_sees_the_shaft_behind_the_tip_and_how_fast_the_tip_gets_on() -> None:
    task = ScopeTask(TaskConfig(imager=True, design=DESIGN), worlds=1, bank=short_bank())
    begun = task.reset(np.arange(1), [0])["imager"][0]
    np.testing.assert_allclose(begun[:3] * 0.3, task.seen.tip[0], atol=1e-6)
    np.testing.assert_allclose(begun[9:12], 0.0)
    shaft = begun[12:].reshape(-1, 3) * 0.3
    assert np.abs(shaft[:, :2]).max() < 1e-6
    np.testing.assert_allclose(shaft[:2, 2], [-0.1, -0.2], atol=0.5 * (task.bank.scene.options.sample_spacing or 0.0))
    seen = [task.step(np.array([[1.0, 0.0, 0.0, 0.0]])).observation for _ in range(20)]
    speed = np.mean([one["imager"][0, 11] for one in seen]) * 0.1
    assert speed == pytest.approx(task.config.drive.push_rate, rel=0.1)
    task.close()
