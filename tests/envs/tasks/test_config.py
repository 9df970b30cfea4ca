"""Every rule of a task changes what an episode sees, is paid, or when it ends."""

from dataclasses import fields, replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from haustra.envs.tasks.config import Drive, Limits, Randomisation, TaskConfig, Weights
from haustra.envs.tasks.observation import sizes
from haustra.envs.tasks.scope_task import ScopeTask
from tests.task_bank import DESIGN, short_bank

PINNED = Randomisation(
    friction=(0.1, 0.1),
    wall_stiffness=(1500.0, 1500.0),
    shaft_stiffness=(1.0, 1.0),
    wire_gain=(1.0, 1.0),
    wire_slack=(0.0, 0.0),
    start_roll=(0.0, 0.0),
)
PAID = Weights(**{entry.name: 0.5 for entry in fields(Weights)})
ENDED = Limits(seconds=1.0, perforation_force=0.5, safe_force=0.4, caecum_margin=0.2)
"""So that a short episode is perforated and reaches its end."""
BASE = TaskConfig(design=DESIGN, observation="state", randomisation=PINNED, weights=PAID, limits=ENDED)
CHANGES: dict[str, Any] = {
    "randomisation.friction": (0.5, 0.5),
    "randomisation.wall_stiffness": (700.0, 700.0),
    "randomisation.shaft_stiffness": (2.0, 2.0),
    "randomisation.wire_gain": (0.5, 0.5),
    "randomisation.wire_slack": (0.3, 0.3),
    "randomisation.start_roll": (1.0, 1.0),
    "drive.control_interval": 0.06,
    "drive.push_rate": 0.03,
    "drive.roll_rate": 0.5,
    "drive.wheel_rate": 1.0,
    "drive.hand_lead": 0.001,
    "limits.perforation_force": 500.0,
    "limits.safe_force": 50.0,
    "limits.caecum_margin": 0.03,
    "limits.pace": 2.0,
    **{f"weights.{entry.name}": 1.5 for entry in fields(Weights)},
}
SEEN: dict[str, dict[str, Any]] = {
    "observation": {"observation": "lumen"},
    "privileged": {"observation": "dict", "privileged": True},
    "imager": {"observation": "dict", "imager": True},
    "memory": {"observation": "dict", "memory": (1.0,)},
    "depth": {"observation": "dict", "depth": True},
    "pictures": {"observation": "dict", "pictures": True},
    "picture_size": {"observation": "depth", "picture_size": 32},
}
ELSEWHERE = {
    *("task", "design", "difficulty", "seeds", "mesentery", "stool", "mucus"),
    *("gas", "gas_flow", "gas_start", "gas_action", "water", "bleeding"),
}
"""What is examined, of which tests/envs/tasks has files of its own."""


@cache
def _episode(path: str = "", value: Any = None) -> np.ndarray:
    config = BASE
    if path:
        part, _, name = path.partition(".")
        config = replace(BASE, **{part: replace(getattr(BASE, part), **{name: value})})
    task, rows = ScopeTask(config, bank=short_bank()), []
    task.reset(seeds=[0], case=0)
    for step in range(30):
        done = task.step(np.array([[1.0, 0.6, 1.0 if step < 20 else -1.0, 0.4]]))
        ends = (done.terminated[0], done.truncated[0])
        rows.append([*np.concatenate([part.ravel() for part in done.observation.values()]), done.reward[0], *ends])
    return np.array(rows, float)


@pytest.mark.parametrize("path", CHANGES)
def test_it_changes_an_episode(path: str) -> None:
    assert not np.allclose(_episode(path, CHANGES[path]), _episode(), rtol=1e-6, atol=1e-9)


def test_an_episode_ends_when_its_time_is_up() -> None:
    config = replace(BASE, limits=Limits(seconds=0.08))
    task = ScopeTask(config, bank=short_bank())
    task.reset(seeds=[0], case=0)
    truncated = [bool(task.step(np.zeros((1, 4))).truncated[0]) for _ in range(3)]
    assert truncated == [False, True, True]


@pytest.mark.parametrize("name", SEEN)
def test_it_changes_what_is_seen(name: str) -> None:
    changed = SEEN[name]
    usual = replace(BASE, **{key: value for key, value in changed.items() if key != name})
    assert sizes(replace(BASE, **changed)) != sizes(usual)


def test_every_rule_is_here() -> None:
    parts = {"drive": Drive, "limits": Limits, "randomisation": Randomisation, "weights": Weights}
    inner = {f"{part}.{entry.name}" for part, kind in parts.items() for entry in fields(kind)}
    assert inner == {*CHANGES, "limits.seconds"}
    assert {entry.name for entry in fields(TaskConfig)} == {*parts, *SEEN, *ELSEWHERE}
