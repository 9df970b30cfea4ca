"""Whole insertions on two engines, world by world under the same seed: how far the means of their scores are apart.

Which way a scope snaps past a fold depends on the last digit, so single runs drift apart and only statistics can agree.
Each seed draws a colon, friction, stiffness of wall and shaft, wires and the angle at the start; the same driver
decides.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy import stats

from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.config import Limits, TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver
from haustra.envs.tasks.scope_task import ACTIONS, ScopeTask
from haustra.errors import InvalidOptionError
from haustra.scripts.bench.agreement.row import Agreement

_REASONS = {
    "jax": "friction is regularised at 1 mm/s in JAX, at some mm/s by MuJoCo; one bend is held to 10 % too",
    "warp": "single precision, and planes put where spheres are, natively where they are expected to be",
}
_PERFORATED = "the same, of all runs; a perforation ends a run"


@dataclass(frozen=True)
class Runs:
    """Scores of one engine's insertions; one entry a world, NaN where it diverged."""

    reach: Float[np.ndarray, " worlds"]
    """Furthest tip over the colon's length [1]."""
    push: Float[np.ndarray, " worlds"]
    """Mean size of the hand's push [N]."""
    wall: Float[np.ndarray, " worlds"]
    """Mean over time of the largest wall force on one link [N]."""
    looping: Float[np.ndarray, " worlds"]
    """Most scope inside beyond the colon passed [m]."""
    perforated: Float[np.ndarray, " worlds"]
    """1 where the wall force ended the run."""
    diverged: int


_TOLERANCE = 0.1
"""Of every mean."""
_NAMES = {
    "reach": "reach",
    "push": "mean push",
    "wall": "mean wall force",
    "looping": "peak looping",
    "perforated": "perforations",
}


def run_seeds(
    bank: ColonSet,
    *,
    engine: str,
    seeds: int,
    seconds: float,
    threads: int = 1,
    progress: Callable[[float], None] = lambda done: None,
) -> Runs:
    """Let the lumen follower insert one scope a seed.

    Args:
        bank: the colons.
        engine: 'native', or one of `haustra.envs.sim.device_engines`.
        seeds: how many, from 0 on.
        seconds: of each run, unless it reaches the caecum or perforates the wall [s].
        threads: of the native engine.
        progress: told the simulated time [s].
    """
    config = TaskConfig(design=bank.design.name, observation="state", limits=Limits(seconds=seconds))
    task = ScopeTask(config, worlds=seeds, threads=threads, engine=engine, bank=bank)
    seen = task.reset(seeds=list(range(seeds)))
    driver = FollowerDriver(task)
    driver.begin(np.ones(seeds, bool))
    running, (diverged, perforated) = np.ones(seeds, bool), np.zeros((2, seeds), bool)
    count, sums, peaks = np.zeros(seeds), np.zeros((2, seeds)), np.zeros((2, seeds))
    action = np.zeros((seeds, len(ACTIONS)))
    while running.any():
        action[running] = driver.act(seen)[running]
        done = task.step(action)
        seen, now = done.observation, done.info
        diverged |= running & now["diverged"]
        perforated |= running & now["perforated"]
        count += running
        sums += running * np.nan_to_num([np.abs(now["push_force"]), now["wall_force"]])
        reached = now["tip_arc"] / task.bank.lengths[task.case]
        peaks = np.maximum(peaks, running * np.nan_to_num([reached, now["excess"]]))
        running = running & ~done.terminated & ~done.truncated
        progress(float(now["time"].max()))
    task.close()
    rows = np.where(diverged, np.nan, [*peaks, *(sums / count), perforated])
    reach, looping, push, wall, ended = rows
    return Runs(reach=reach, push=push, wall=wall, looping=looping, perforated=ended, diverged=int(diverged.sum()))


def compare_insertions(known: Runs | None, found: Mapping[str, Runs | str]) -> list[Agreement]:
    """Mean differences of scores as shares of the native mean, over seeds that neither engine lost; shares as they are.

    Args:
        known: the native engine's; only needed where another ran.
        found: each engine's, or why it is absent.

    Raises:
        InvalidOptionError: when fewer than three seeds are left.
    """
    rows = []
    for engine, runs in found.items():
        for name, said in _NAMES.items():
            perforations = name == "perforated"
            unit, reason = ("of all", _PERFORATED) if perforations else ("of the mean", _REASONS[engine])
            row = Agreement(f"insertion, mean over seeds: {said}", engine, _TOLERANCE, unit, reason)
            if isinstance(runs, str):
                rows.append(row.without(engine, runs))
                break
            assert known is not None
            rows.append(_compared(row, getattr(known, name), getattr(runs, name)))
    return rows


def _compared(row: Agreement, known: np.ndarray, found: np.ndarray) -> Agreement:
    both = np.isfinite(known) & np.isfinite(found)
    apart, count = (found - known)[both], int(both.sum())
    if count < 3:
        raise InvalidOptionError(f"{count} seeds ran on both engines: ask for at least three.")
    scale = 1.0 if row.unit == "of all" else float(known[both].mean())
    mean = float(apart.mean()) / scale
    half = float(stats.t.ppf(0.975, count - 1) * stats.sem(apart)) / scale
    return replace(row, difference=mean, interval=(mean - half, mean + half))
