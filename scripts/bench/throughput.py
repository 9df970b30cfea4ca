"""How fast many scopes step at once on a backend: worlds against rate."""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.linear_insertions import LinearInsertions
from haustra.envs.runs.tally import Insertions
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.load import load_backend
from haustra.envs.sim.scope_colon_set import ScopeColonSet
from haustra.scripts.bench.linear import INTERVAL, Hands, conditions

_REPEATS = 3
_STEPS = 200
"""Time steps of one timed call."""
_WARM_UP = 5.0
"""Time that scopes are driven in before anything is timed [s], after which they lie against the wall."""


@dataclass(frozen=True)
class Rate:
    """One row: that many worlds."""

    worlds: int
    steps_per_s: float
    """Physics steps of all worlds in a second; median of three calls."""
    simulated_per_s: float
    """Simulated seconds of all worlds in a second of wall clock."""
    first_step_s: float
    """Making the batch and its first step, what is compiled included."""
    healthy: float
    """Share of worlds that did not diverge."""
    in_contact: float
    """Share of worlds that touch the wall while they are timed."""


def measure_rates(
    bank: ScopeColonSet,
    worlds: Sequence[int],
    *,
    backend: str = "linear",
    threads: int = 1,
    progress: Callable[[Rate], None] = lambda rate: None,
) -> list[Rate]:
    """Time the scopes of a bank in its colons, in single precision, under hands that push, roll and pull at random.

    Args:
        bank: a scope and colons.
        worlds: numbers of worlds to try.
        backend: as for `haustra.envs.sim.load.load_backend`.
        threads: of the CPU.
        progress: called with each row.
    """
    rates = []
    for count in worlds:
        rates.append(_measure(bank, count, backend=backend, threads=threads))
        progress(rates[-1])
    return rates


def _measure(bank: ScopeColonSet, count: int, *, backend: str, threads: int) -> Rate:
    began, every, timestep = time.perf_counter(), np.arange(count), bank.scene.options.timestep
    batch = load_backend(backend, bank.scene, bank.tables, worlds=count, threads=threads)
    batch.reset(every, every % len(bank.colons), conditions(bank, count))
    hands, seconds = Hands(count), []
    healthy = batch.step(hands.next(), 1)
    first = time.perf_counter() - began
    for _ in range(round(_WARM_UP / INTERVAL)):
        batch.step(hands.next(), round(INTERVAL / timestep))
    for _ in range(_REPEATS):
        inputs, began = hands.next(), time.perf_counter()
        healthy = batch.step(inputs, _STEPS)
        seconds.append(time.perf_counter() - began)
    touching = (batch.read().link_forces > 0).any(axis=1)
    batch.close()
    rate = _STEPS * count / float(np.median(seconds))
    return Rate(count, rate, rate * timestep, first, float(np.mean(healthy)), float(touching.mean()))


def measure_insertions(
    bank: ScopeColonSet, count: int, *, seconds: float, backend: str = "linear", threads: int = 1
) -> dict[str, Any]:
    """Time that many insertions from the first call to the last score, with friction from 0.03 to 0.1.

    Args:
        bank: a scope and colons, which the insertions share.
        count: how many.
        seconds: simulated time of each [s].
        backend: 'linear', 'linear-gpu' or 'warp'.
        threads: of the CPU.
    """
    colons, began = np.arange(count) % len(bank.names), time.perf_counter()
    runs = _inserted(bank, colons, np.linspace(0.03, 0.1, count), seconds=seconds, backend=backend, threads=threads)
    taken = time.perf_counter() - began
    reach = runs.tip_arc_max / np.array(bank.lengths)[colons]
    return {
        "count": count,
        "simulated_s_each": seconds,
        "wall_clock_s": taken,
        "outcomes": dict(Counter(outcome.value for outcome in runs.outcome)),
        "reach_mean": float(reach.mean()),
        "reach_max": float(reach.max()),
        "push_force_peak_mean_N": float(runs.push_force_peak.mean()),
        "wall_force_peak_mean_N": float(runs.wall_force_peak.mean()),
    }


def _inserted(
    bank: ScopeColonSet, colons: np.ndarray, friction: np.ndarray, *, seconds: float, backend: str, threads: int
) -> Insertions:
    count = len(colons)
    if backend == "warp":
        from haustra.envs.runs.insertions import run_insertions

        return run_insertions(bank, worlds=count, seconds=seconds, colon=colons, friction=friction)
    settings, device = FollowerSettings(straighten=bank.scene.options.mesentery), "cpu"
    if backend == "linear-gpu":
        device = "cuda"
    batch = LinearInsertions(
        bank.scene, bank.tables, bank.colons, worlds=count, settings=settings, threads=threads, device=device
    )
    one = np.ones(count)
    batch.begin(colons, Conditions(friction, bank.scene.options.wall_stiffness * one, one))
    return batch.run(seconds=seconds)


def rate_rows(rates: Sequence[Rate]) -> list[dict[str, float]]:
    """Rows as plain JSON values."""
    return [asdict(rate) for rate in rates]
