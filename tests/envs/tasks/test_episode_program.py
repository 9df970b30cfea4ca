"""The program of episodes: one text for a CPU and for NVIDIA's GPUs."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from haustra.envs.sim.linear.compile import assembled, write_kernel, write_program
from haustra.envs.tasks.config import Randomisation, TaskConfig, Weights
from haustra.envs.tasks.episode import EpisodeRules
from haustra.envs.tasks.episode_program import UNREAD, EpisodeProgram

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


def whole(config: TaskConfig) -> EpisodeProgram:
    """A program that holds what it does not read, too."""
    own = program(config)
    object.__setattr__(own, "rules", EpisodeRules(config, 0.04))
    return own


def test_programs_read_nothing_of_a_task_that_is_left_out_of_them():
    """Tasks that differ in what is left out share a program: with that the text is the same to the letter."""
    gassed = replace(PLAIN, mesentery=True, gas=1500.0)
    changed: dict[str, Any] = {"design": "adult", "difficulty": "easy", "seeds": (3, 9), "gas_flow": 1e-5}
    changed |= {"gas_start": 900.0, "water": 1e-4, "bleeding": True, "picture_size": 24}
    changed["randomisation"] = Randomisation(friction=(0.5, 0.6))
    other = replace(gassed, **changed, gas=3000.0)
    assert {*changed, "stool", "mucus"} == set(UNREAD)  # these two are of pictures, which no program draws
    assert all(getattr(gassed, name) != value for name, value in changed.items())
    about = {"lanes": 8, "real": np.float32, "timestep": 0.005, "angles": 48, "one_design": True, "moving": False}
    one, two = (write_program(**about, driver=whole(config)) for config in (gassed, other))
    assert one == two and whole(gassed) != whole(other)
    assert program(gassed) == program(other) != program(PLAIN)


def test_rows_of_what_is_told_lie_side_by_side_and_begin_with_what_is_over():
    own = program(EVERYTHING)
    edges = [(rows.start, rows.stop) for rows in own.rows.values()]
    assert next(iter(own.rows)) == "over"
    assert [start for start, _ in edges] == [0, *(stop for _, stop in edges[:-1])]
    assert own.tells == edges[-1][1]
    assert "lumen" in own.rows and "depth" not in own.rows
