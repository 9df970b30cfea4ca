"""Speed and memory of episodes, at a size for tests."""

import numpy as np
import pytest

from haustra.envs.tasks.config import TaskConfig
from haustra.errors import InvalidOptionError
from haustra.scripts.bench.episodes import _slope, memory_slope, step_rate
from tests.task_bank import DESIGN, short_bank

CONFIG = TaskConfig(design=DESIGN, observation="state")


def test_rates_are_of_the_environment():
    rate = step_rate(CONFIG, short_bank(), worlds=2, threads=1, seconds=1.0)
    assert rate.simulated_per_second == pytest.approx(rate.per_second * 0.04)
    assert 1e-5 < rate.cpu_per_step < 1.0
    assert rate.depth > 0.04


def test_the_program_of_linear_time_is_compared_with_numpy():
    rate = step_rate(CONFIG, short_bank(), worlds=8, threads=1, seconds=1.0, backend="linear", compare=True)
    assert rate.on_host_per_second and rate.in_place_per_second and rate.on_host_cpu_per_step
    with pytest.raises(InvalidOptionError, match="leave compare out"):
        step_rate(CONFIG, short_bank(), worlds=1, threads=1, seconds=1.0, compare=True)


def test_pictures_are_timed_alone_and_in_episodes():
    config = TaskConfig(design=DESIGN, observation="pixels", picture_size=16)
    rate = step_rate(config, short_bank(), worlds=4, threads=1, seconds=0.2, backend="linear")
    assert rate.drawn_per_second and rate.looks_per_second and rate.in_place_per_second
    assert min(rate.drawn_per_second, rate.looks_per_second, rate.in_place_per_second) > 0


def test_memory_does_not_grow_with_steps_and_resets():
    found = memory_slope(CONFIG, short_bank(), worlds=8, steps=4000, resets=2000)
    assert abs(found.bytes_per_step) < 40
    assert abs(found.bytes_per_reset) < 100


def test_a_leak_would_show():
    steps = np.arange(0, 1000, 20.0)
    assert _slope(np.column_stack([steps, 1e6 + 64 * steps])) == pytest.approx(64)
    jump = np.column_stack([steps, np.where(steps > 150, 2e6, 1e6)])
    assert _slope(jump) == 0.0
