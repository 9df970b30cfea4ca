"""How fast episodes go, and whether memory grows with them."""

import gc
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from haustra.envs.tasks.actions import ACTIONS
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver
from haustra.envs.tasks.episode_program import IN_PROGRAM
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError, UnsupportedSceneError

_WARM_UP = 20
"""Steps and resets before memory is first read: caches fill, threads start."""


_LOOKS = 10
"""Observations that are timed."""
_IN_PLACE = 50
"""Control steps that are timed without fetching what they lead to."""


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
    on_host_per_second: float | None
    """As `per_second`, where numpy works out what is seen and paid instead of the backend's program, turn by turn with
    it [1/s]; None where nobody asked."""
    on_host_cpu_per_step: float | None
    """As `cpu_per_step`, likewise [s]."""
    in_place_per_second: float | None
    """As `per_second`, where actions and all that they lead to stay in the program's arrays [1/s]; None where it has
    none."""
    drawn_per_second: float | None
    """Pictures over all worlds, drawn where no step is taken and left where they lie [1/s]; None where programs draw
    none."""
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
    compare: bool = False,
) -> StepRate:
    """Let the follower insert scopes for `seconds` of simulated time, and time the environment's own part.

    Args:
        config: the rules.
        bank: the colons.
        worlds: stepped together.
        threads: of the CPU.
        seconds: simulated time of each world [s].
        backend: as for `ScopeTask`.
        compare: time the same episodes with numpy in place of the backend's program, too.

    Raises:
        InvalidOptionError: when they are to be compared and the backend has no such program.
    """
    linear = backend.startswith("linear")
    if compare and not linear:
        raise InvalidOptionError(
            "Only the backends 'linear' and 'linear-gpu' have episodes in their program: leave compare out."
        )
    about = {"worlds": worlds, "threads": threads, "backend": backend, "bank": bank}
    turns = [
        _Timed(ScopeTask(config, **about, on_host=on_host)) for on_host in ((False, True) if compare else (False,))
    ]
    steps = max(1, round(seconds / turns[0].task.interval))
    for _ in range(steps):
        for turn in turns:
            turn.step()
    task, count = turns[0].task, steps * worlds
    in_program = linear and not compare and set(task.parts) <= set(IN_PROGRAM)
    looks = (
        None
        if config.observation == "state" or in_program
        else _per_second(turns[-1].task, turns[-1].task.observe, _LOOKS)
    )
    depth = float(task.seen.tip_arc.mean())
    in_place = _in_place_per_second(task) if linear else None
    drawn = _per_second(task, task.draw, _LOOKS) if linear and "pixels" in task.parts else None
    for turn in turns:
        turn.task.close()
    rate, other = count / turns[0].wall, turns[1] if compare else None
    return StepRate(
        worlds,
        per_second=rate,
        simulated_per_second=rate * task.interval,
        cpu_per_step=turns[0].cpu / count,
        looks_per_second=looks,
        on_host_per_second=other and count / other.wall,
        on_host_cpu_per_step=other and other.cpu / count,
        in_place_per_second=in_place,
        drawn_per_second=drawn,
        depth=depth,
    )


class _Timed:
    """A task that the follower drives, timed."""

    def __init__(self, task: ScopeTask) -> None:
        self.task, self.wall, self.cpu = task, 0.0, 0.0
        self._seen, self._driver = task.reset(seeds=list(range(task.worlds))), FollowerDriver(task)
        self._over = np.ones(task.worlds, bool)
        self._driver.begin(self._over)
        task.step(np.zeros((task.worlds, len(ACTIONS))))  # compilation, where there is one, is not the rate
        self._over[:] = False

    def step(self) -> None:
        """One control step, as vector environments take it: episodes that were over begin anew."""
        action = self._driver.act(self._seen)
        began, used = time.perf_counter(), time.process_time()
        done = self.task.step(action, self._over)
        self.wall += time.perf_counter() - began
        self.cpu += time.process_time() - used
        self._driver.begin(self._over)
        self._seen, self._over = done.observation, done.terminated | done.truncated


def _in_place_per_second(task: ScopeTask) -> float:
    over = task.advance()
    began = time.perf_counter()
    for _ in range(_IN_PLACE):
        over = task.advance(over)
    return _IN_PLACE * task.worlds / (time.perf_counter() - began)


def _per_second(task: ScopeTask, act: Callable[[], object], times: int) -> float:
    began = time.perf_counter()
    for _ in range(times):
        act()
    return times * task.worlds / (time.perf_counter() - began)


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
    gc.collect()
    gc.freeze()  # what the process held before is not walked anew at each reading

    def repeat(action: Callable[[], object], times: int, done_before: int) -> float:
        for _ in range(_WARM_UP):
            action()
        read, every = [], max(1, times // 50)
        for turn in range(times):
            action()
            if turn % every == 0:
                gc.collect()  # garbage that waits for its collector is no leak
                read.append((turn * worlds, resident_memory()))
                progress(done_before + turn * worlds)
        return _slope(np.array(read, float))

    per_reset = repeat(task.reset, max(2, resets // worlds), 0)
    per_step = repeat(lambda: task.step(random.uniform(-1, 1, (worlds, 4))), max(2, steps // worlds), resets)
    task.close()
    gc.unfreeze()
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
