"""How fast episodes go, and whether memory grows with them."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver
from haustra.envs.tasks.scope_task import ACTIONS, ScopeTask
from haustra.errors import UnsupportedSceneError

_WARM_UP = 20
"""Steps and resets before memory is first read: caches fill, threads start."""


_LOOKS = 10
"""Observations that are timed."""


@dataclass(frozen=True)
class StepRate:
    """Speed of a task's worlds."""

    worlds: int
    per_second: float
    """Environment steps over all worlds per second of wall clock [1/s], the driver's own time not counted."""
    simulated_per_second: float
    """Simulated time over all worlds per wall clock [1]."""
    cpu_per_step: float
    """Processor time of one environment step of one world [s]: it does not depend on what else runs."""
    looks_per_second: float | None
    """Observations over all worlds per second, where no step is taken [1/s]; None where they are measured anyway."""
    depth: float
    """Mean arc length of the tips at the end [m]: contacts, and with them the cost, grow with it."""


def step_rate(
    config: TaskConfig,
    bank: ColonSet,
    *,
    worlds: int,
    threads: int,
    seconds: float,
    backend: str = "native",
) -> StepRate:
    """Let the follower insert scopes for `seconds` of simulated time, and time the environment's own part."""
    task = ScopeTask(config, worlds=worlds, threads=threads, backend=backend, bank=bank)
    seen = task.reset(seeds=list(range(worlds)))
    driver = FollowerDriver(task)
    driver.begin(np.ones(worlds, bool))
    wall = cpu = 0.0
    task.step(np.zeros((worlds, len(ACTIONS))))  # compilation, where there is one, is not the rate
    steps = max(1, round(seconds / task.interval))
    for _ in range(steps):
        action = driver.act(seen)
        began, used = time.perf_counter(), time.process_time()
        done = task.step(action)
        wall += time.perf_counter() - began
        cpu += time.process_time() - used
        seen, over = done.observation, done.terminated | done.truncated
        if over.any():
            seen = task.reset(np.flatnonzero(over))
            driver.begin(over)
    looks = None if config.observation == "state" else _looks_per_second(task)
    task.close()
    count, depth = steps * worlds, float(task.seen.tip_arc.mean())
    return StepRate(worlds, count / wall, count * task.interval / wall, cpu / count, looks, depth)


def _looks_per_second(task: ScopeTask) -> float:
    began = time.perf_counter()
    for _ in range(_LOOKS):
        task.observe()
    return _LOOKS * task.worlds / (time.perf_counter() - began)


@dataclass(frozen=True)
class MemorySlope:
    """How resident memory grows."""

    steps: int
    """Environment steps over all worlds."""
    resets: int
    bytes_per_step: float
    """Slope of a straight line through resident memory over steps [B]."""
    bytes_per_reset: float
    """Slope of a straight line through resident memory over resets [B]."""


def memory_slope(
    config: TaskConfig,
    bank: ColonSet,
    *,
    worlds: int,
    steps: int,
    resets: int,
    progress: Callable[[int], None] = lambda done: None,
) -> MemorySlope:
    """Step and reset many times, and read resident memory on the way.

    Args:
        config: the rules.
        bank: the colons.
        worlds: stepped together.
        steps: environment steps over all worlds.
        resets: worlds reset, over all.
        progress: told steps and resets done.

    Raises:
        UnsupportedSceneError: on a system that does not tell resident memory.
    """
    task = ScopeTask(config, worlds=worlds, bank=bank)
    task.reset(seeds=list(range(worlds)))
    random = np.random.default_rng(0)

    def repeat(action: Callable[[], object], times: int, done_before: int) -> float:
        for _ in range(_WARM_UP):
            action()
        read, every = [], max(1, times // 50)
        for turn in range(times):
            action()
            if turn % every == 0:
                read.append((turn * worlds, resident_memory()))
                progress(done_before + turn * worlds)
        return _slope(np.array(read, float))

    per_reset = repeat(task.reset, max(2, resets // worlds), 0)
    per_step = repeat(lambda: task.step(random.uniform(-1, 1, (worlds, 4))), max(2, steps // worlds), resets)
    task.close()
    return MemorySlope(steps, resets, per_step, per_reset)


def resident_memory() -> int:
    """Memory of this process now [B].

    Raises:
        UnsupportedSceneError: on a system that does not tell.
    """
    try:
        with open("/proc/self/statm", encoding="ascii") as file:  # noqa: PTH123 - read thousands of times
            return int(file.read().split()[1]) * 4096
    except OSError as error:
        raise UnsupportedSceneError("This system does not tell resident memory: measure on Linux.") from error


def _slope(read: Float[np.ndarray, "readings 2"]) -> float:
    """Theil-Sen's median slope, which a single jump of the allocator does not move; 0 for fewer than three readings."""
    if len(read) < 3:
        return 0.0
    first, second = np.triu_indices(len(read), k=1)
    return float(np.median((read[second, 1] - read[first, 1]) / (read[second, 0] - read[first, 0])))
