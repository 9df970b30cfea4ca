"""Dealing: every episode of a plan once, the next one waiting to the first world that is free."""

import numpy as np

from haustra.envs.learning.dealing import deal
from haustra.envs.tasks.device_task import DeviceTask
from haustra.envs.tasks.observation import Observation
from haustra.envs.tasks.step import Step

PLAN = [(0, 3), (0, 1), (1, 4), (1, 1), (2, 2)]
"""Cases, and seeds, which here are how many steps an episode takes."""


class Clockwork(DeviceTask):
    """Worlds that count down from a seed; they see how much is left, and what was begun is noted."""

    def __init__(self, worlds: int) -> None:
        self.worlds, self.left, self.dealt = worlds, np.zeros(worlds, int), list[tuple[int, int, int]]()

    def reset(self, worlds=None, seeds=None, case=None):
        assert worlds is not None and seeds is not None and case is not None
        self.left[worlds] = seeds
        self.dealt += zip(worlds.tolist(), case.tolist(), seeds, strict=True)
        return self.observe()

    def step(self, action: np.ndarray) -> Step:
        assert (action == self.left).all(), "a driver acts by what is seen now"
        self.left -= 1
        over = self.left <= 0
        return Step(
            self.observe(), np.zeros(self.worlds), over, np.zeros(self.worlds, bool), {"left": self.left.copy()}
        )

    def observe(self):
        return {"state": self.left.copy()}


class Copyist:
    """Does what it sees, and notes where episodes begin."""

    def __init__(self) -> None:
        self.begun = list[list[bool]]()

    def begin(self, worlds: np.ndarray) -> None:
        self.begun.append(worlds.tolist())

    def act(self, seen: Observation) -> np.ndarray:
        return seen["state"]


def test_the_next_that_waits_goes_to_the_first_world_that_is_free() -> None:
    task, driver = Clockwork(2), Copyist()
    turns = list(deal(task, driver, PLAN))
    assert task.dealt == [(0, 0, 3), (1, 0, 1), (1, 1, 4), (0, 1, 1), (0, 2, 2)]
    assert [turn.begun for turn in turns] == [{0: 0, 1: 1}, {1: 2}, {}, {0: 3}, {0: 4}, {}]
    assert driver.begun == [[True, True], [False, True], [True, False], [True, False]]
    ended = [(at, one.number, one.world, one.steps) for at, turn in enumerate(turns) for one in turn.ended]
    assert ended == [(0, 1, 1, 1), (2, 0, 0, 3), (3, 3, 0, 1), (4, 2, 1, 4), (5, 4, 0, 2)]
    assert all(one.last == {"left": 0} for turn in turns for one in turn.ended)


def test_any_number_of_worlds_gives_every_episode_once() -> None:
    for worlds in (1, 3, 8):
        turns = list(deal(Clockwork(worlds), Copyist(), PLAN))
        found = {one.number: one.steps for turn in turns for one in turn.ended}
        assert [found[number] for number in range(len(PLAN))] == [seed for _, seed in PLAN]
        assert sum(len(turn.ended) for turn in turns) == len(PLAN)


def test_nothing_is_stepped_for_an_empty_plan() -> None:
    assert list(deal(Clockwork(2), Copyist(), [])) == []
