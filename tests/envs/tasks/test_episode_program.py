"""The program of episodes: one text for a CPU and for NVIDIA's GPUs."""

import numpy as np
import pytest

from haustra.envs.sim.linear.compile import assembled, write_kernel, write_program
from haustra.envs.tasks.config import TaskConfig, Weights
from haustra.envs.tasks.episode import EpisodeRules
from haustra.envs.tasks.episode_program import EpisodeProgram

PLAIN = TaskConfig(observation="state")
EVERYTHING = TaskConfig(imager=True, privileged=True, memory=(1.0, 5.0), weights=Weights(facing=1.0, looping=1.0))


def program(config: TaskConfig) -> EpisodeProgram:
    return EpisodeProgram(rules=EpisodeRules(config, 0.04), steps=8, coils=tuple(range(8)))


@pytest.mark.parametrize("config", [pytest.param(PLAIN, marks=pytest.mark.thorough), EVERYTHING])
def test_a_gpu_takes_it_without_calling_anything_else(config):
    """NVIDIA's driver has no library of mathematics: whatever is called must be in the text."""
    about = {"real": np.float32, "timestep": 0.005, "angles": 64, "one_design": True, "moving": True}
    text = assembled(write_kernel(**about, driver=program(config)))
    assert ".visible .entry advance" in text
    assert ".extern" not in text
    assert write_program(lanes=8, **about, driver=program(config))


def test_rows_of_what_is_told_lie_side_by_side_and_begin_with_what_is_over():
    own = program(EVERYTHING)
    edges = [(rows.start, rows.stop) for rows in own.rows.values()]
    assert next(iter(own.rows)) == "over"
    assert [start for start, _ in edges] == [0, *(stop for _, stop in edges[:-1])]
    assert own.tells == edges[-1][1]
    assert "lumen" in own.rows and "depth" not in own.rows
