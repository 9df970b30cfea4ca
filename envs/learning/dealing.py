"""Episodes of a plan, dealt to worlds as these come free: whoever drives, each gets the same, in whichever world."""

from collections.abc import Iterator, Sequence
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from haustra.envs.tasks.device_task import DeviceTask
from haustra.envs.tasks.drivers import Driver
from haustra.envs.tasks.scope_task import ScopeTask


class Ended(NamedTuple):
    """An episode that is over."""

    number: int
    """Its place in the plan."""
    world: int
    steps: int
    """Steps that it took, the last of them just now."""
    last: dict[str, Any]
    """What `Step.info` says of its world."""


class Turn(NamedTuple):
    """One step of all worlds."""

    begun: dict[int, int]
    """Worlds in which an episode began before this step, and its place in the plan."""
    info: dict[str, np.ndarray]
    """As in `Step`."""
    ended: list[Ended]
    """Episodes that this step was the last of."""


def planned(colons: int, episodes: int) -> list[tuple[int, int]]:
    """Case and seed of so many episodes in each colon: episode e in colon k draws by the seed 1000 k + e."""
    return [(case, 1000 * case + episode) for case in range(colons) for episode in range(episodes)]


def deal(task: ScopeTask | DeviceTask, driver: Driver, plan: Sequence[tuple[int, int]]) -> Iterator[Turn]:
    """Drive every episode of a plan, step by step.

    Worlds for which no episode is left are stepped on in vain.

    Args:
        task: its worlds; reset by this.
        driver: of all worlds.
        plan: case and seed of each episode (`planned`).
    """
    waiting, free = iter(range(len(plan))), list(range(task.worlds))
    running, seen = dict[int, tuple[int, int]](), {}
    for step in count():
        begun = dict(zip(free, waiting, strict=False))
        if begun:
            cases, seeds = np.array([plan[number] for number in begun.values()]).T
            seen = task.reset(np.array(list(begun)), seeds.tolist(), cases)
            driver.begin(np.isin(np.arange(task.worlds), list(begun)))
            running |= {world: (number, step) for world, number in begun.items()}
        if not running:
            return
        done = task.step(driver.act(seen))
        seen = done.observation
        free = [world for world in np.flatnonzero(done.terminated | done.truncated).tolist() if world in running]
        ended = list[Ended]()
        for world in free:
            number, first = running.pop(world)
            last = {name: values[world] for name, values in done.info.items()}
            ended.append(Ended(number, world, step + 1 - first, last))
        yield Turn(begun, done.info, ended)
