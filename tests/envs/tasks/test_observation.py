"""What a learner sees beside the moment: running means of what the device measured."""

import numpy as np
import pytest

from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.observation import STATE, Memory, sizes
from haustra.errors import InvalidOptionError


def test_a_running_mean_forgets_by_1_over_e_in_its_time() -> None:
    interval, times = 0.01, (0.5, 2.0)
    memory = Memory(times, 2, interval)
    before, after = np.zeros((2, len(STATE))), np.ones((2, len(STATE)))
    memory.begin(np.arange(2), before)
    for _ in range(50):
        memory.add(after)
    left = memory.recent(after).reshape(2, len(times), len(STATE))
    np.testing.assert_allclose(left[:, 0], np.exp(-1), rtol=1e-4)
    np.testing.assert_allclose(left[:, 1], np.exp(-0.25), rtol=1e-4)


def test_a_world_that_begins_anew_remembers_nothing_and_its_neighbour_all() -> None:
    memory = Memory((1.0,), 2, 0.1)
    memory.begin(np.arange(2), np.zeros((2, len(STATE))))
    now = np.ones((2, len(STATE)))
    memory.begin(np.array([1]), now)
    left = memory.recent(now)
    assert np.all(left[0] == 1.0)
    assert np.all(left[1] == 0.0)


def test_memory_comes_under_its_own_name_only() -> None:
    assert sizes(TaskConfig(memory=(1.0, 5.0)))["recent"] == (2 * len(STATE),)
    assert "recent" not in sizes(TaskConfig())
    with pytest.raises(InvalidOptionError, match="names of their own"):
        sizes(TaskConfig(observation="state", memory=(1.0,)))
    with pytest.raises(InvalidOptionError, match="over 0"):
        TaskConfig(memory=(0.0,))
