"""What programs of linear time read of a task: tests of tasks that differ in the rest share one, written once."""

from dataclasses import fields, replace
from typing import Any

from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.episode_program import EpisodeProgram

UNREAD = (
    "design",
    "difficulty",
    "seeds",
    "gas_flow",
    "gas_start",
    "water",
    "bleeding",
    "picture_size",
    "stool",
    "mucus",
    "randomisation",
)
"""Fields of a task that its program does not read: `test_episode_program` compares programs of tasks that differ."""
_GAS = 2000.0
"""Pressure to which any is set: programs read whether there is a gas action, and no pressure [Pa]."""


def read_by_programs(driver: Any) -> Any:
    """The driver, its task without what its program does not read; other drivers as they are."""
    if not isinstance(driver, EpisodeProgram):
        return driver
    usual = {each.name: getattr(TaskConfig(), each.name) for each in fields(TaskConfig) if each.name in UNREAD}
    config = driver.rules.config
    config = replace(config, **usual, gas=None if config.gas is None else _GAS)
    return replace(driver, rules=replace(driver.rules, config=config))
