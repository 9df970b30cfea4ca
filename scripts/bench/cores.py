"""What several cores are worth to the native batch, beside what the machine and MuJoCo's own threads make of them."""

import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco.batch import Batch

from haustra.envs.sim.conditions import Conditions, Snapshot
from haustra.envs.sim.native_batch import NativeBackend
from haustra.envs.sim.state import Controls
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver
from haustra.envs.tasks.scope_task import ScopeTask

_STRETCH = 8
"""Time steps from one decision to the next, as episodes have them; MuJoCo alone begins again at the same state after
each."""
_PUSH = 0.01
"""Speed of the hand while scopes are timed [m/s]."""


@dataclass(frozen=True)
class Cores:
    """Steps per second on several cores over those on one; medians of pairs that were timed one after the other."""

    cores: int
    worlds: int
    contacts: float
    """Number of contacts that a world has, on average, while it is timed."""
    processes: float
    """Independent processes, each stepping all worlds by MuJoCo alone: what the machine can give."""
    mujoco: float
    """MuJoCo's own batch on its own threads."""
    scopes: float
    """`NativeBackend`, with the wall looked up at every step."""
    steps_per_s: float
    """Steps per second of all scopes on those cores; the best of all pairs."""


def measure_cores(
    bank: ColonSet,
    *,
    cores: int,
    worlds: int,
    before: float,
    repeats: int,
    seconds: float = 1.0,
    progress: Callable[[float, str], None] = lambda done, note: None,
) -> Cores:
    """Drive scopes into contact, and step them from there on one core and on several by turns.

    Args:
        bank: colons and scope.
        cores: how many.
        worlds: how many scopes.
        before: time that the follower drives them in first [s].
        repeats: pairs of each kind.
        seconds: wall clock of each half of a pair [s].
        progress: told the pairs done.
    """
    case, starts = _driven(bank, worlds, before, cores)
    states = np.array([start.state for start in starts])
    pairs: dict[str, list[tuple[float, float]]] = {"processes": [], "mujoco": [], "scopes": []}
    with (
        TemporaryDirectory() as folder,
        ProcessPoolExecutor(cores, mp_context=get_context("spawn")) as pool,
    ):
        scopes = [_scopes(bank, case, threads) for threads in (1, cores)]
        model = scopes[0].model
        path = Path(folder) / "model.mjb"
        mujoco.mj_saveModel(model, str(path))
        contacts = _contacts(model, states)
        batches = [Batch(model, worlds, nthread=threads) for threads in (1, cores)]
        list(pool.map(_alone, [str(path)] * cores, [states] * cores, [0.01] * cores))  # all processes are there now
        for turn in range(repeats):
            progress(turn, "")
            alone, together = (
                sum(pool.map(_alone, [str(path)] * count, [states] * count, [seconds] * count)) for count in (1, cores)
            )
            pairs["processes"].append((alone, together))
            pairs["mujoco"].append((_rate(batches[0], states, seconds), _rate(batches[1], states, seconds)))
            pairs["scopes"].append((_scope_rate(scopes[0], starts, seconds), _scope_rate(scopes[1], starts, seconds)))
        for batch in scopes:
            batch.close()
    progress(repeats, "")
    ratios = {name: float(np.median([several / one for one, several in rows])) for name, rows in pairs.items()}
    best = max(several for _, several in pairs["scopes"])
    return Cores(cores=cores, worlds=worlds, contacts=contacts, steps_per_s=best, **ratios)


def _driven(bank: ColonSet, worlds: int, before: float, threads: int) -> tuple[np.ndarray, list[Snapshot]]:
    """Colons of all worlds, and where the follower has brought the scopes."""
    task = ScopeTask(
        TaskConfig(design=bank.design.name, observation="state"), worlds=worlds, threads=threads, bank=bank
    )
    seen = task.reset(seeds=list(range(worlds)))
    driver = FollowerDriver(task)
    driver.begin(np.ones(worlds, bool))
    for _ in range(round(before / task.interval)):
        seen = task.step(driver.act(seen)).observation
    starts = [task.backend.snapshot(world) for world in range(worlds)]
    case = task.case.copy()
    task.close()
    return case, starts


def _scopes(bank: ColonSet, case: np.ndarray, threads: int) -> NativeBackend:
    batch = NativeBackend(bank.scene, bank.tables, worlds=len(case), threads=threads)
    options, every = bank.scene.options, np.ones(len(case))
    batch.reset(np.arange(len(case)), case, Conditions(options.friction * every, options.wall_stiffness * every, every))
    return batch


def _contacts(model: mujoco.MjModel, states: Float[np.ndarray, "worlds state"]) -> float:
    batch = Batch(model, len(states), nthread=1)
    batch.state[:] = states
    batch.step()
    found = []
    for world in range(len(states)):
        data = batch.get_data(world)
        mujoco.mj_forward(model, data)
        found.append(data.ncon)
    return float(np.mean(found))


def _alone(path: str, states: Float[np.ndarray, "worlds state"], seconds: float) -> float:
    """Steps per second of a process of its own."""
    return _rate(Batch(mujoco.MjModel.from_binary_path(path), len(states), nthread=1), states, seconds)


def _rate(batch: Batch, states: Float[np.ndarray, "worlds state"], seconds: float) -> float:
    def go() -> None:
        batch.state[:] = states
        for _ in range(_STRETCH):
            batch.step()

    return _timed(go, len(states), seconds)


def _scope_rate(batch: NativeBackend, starts: list[Snapshot], seconds: float) -> float:
    """The scopes go on from where they were put: between two decisions a scope hardly moves."""
    for world, start in enumerate(starts):
        batch.restore(world, start)
    count = len(starts)
    inputs = Controls(np.full(count, _PUSH), np.zeros(count), np.zeros((count, 4)))
    return _timed(lambda: batch.step(inputs, _STRETCH), count, seconds)


def _timed(go: Callable[[], object], worlds: int, seconds: float) -> float:
    """Steps per second of all worlds, after one stretch that is not timed."""
    go()
    stretches, began = 0, time.perf_counter()
    while (spent := time.perf_counter() - began) < seconds:
        go()
        stretches += 1
    return stretches * worlds * _STRETCH / spent
