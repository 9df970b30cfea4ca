"""Whole insertions on two engines, world by world under the same seed: how far the means of their scores are apart.

Which way a scope snaps past a fold depends on the last digit, so single runs drift apart and only statistics can agree.
Each seed draws a colon, friction, stiffness of wall and shaft, wires and the angle at the start; the same driver
decides.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy import stats

from haustra.envs.bench.agreement.row import Agreement
from haustra.envs.tasks.bank import Bank
from haustra.envs.tasks.config import Limits, TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver
from haustra.envs.tasks.scope_task import ACTIONS, ScopeTask
from haustra.errors import InvalidOptionError

_CONTACT = (
    "friction is regularised at 1 mm/s in JAX and at some mm/s in MuJoCo's planes, which are placed a step late; "
    "10 % is also what one bend is held to"
)
_REACH = "the same; a tenth of the reach would show in a study"
_NEVER = 1e9
"""No force ends a run [N]: the same stretch of time is compared."""


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
    diverged: int


_QUESTIONS = {
    "reach": (0.05, _REACH),
    "push": (0.1, _CONTACT),
    "wall": (0.1, _CONTACT),
    "looping": (0.1, _CONTACT),
}
_NAMES = {"reach": "reach", "push": "mean push", "wall": "mean wall force", "looping": "peak looping"}


def run_seeds(
    bank: Bank,
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
        engine: 'native' or 'mjx-jax'.
        seeds: how many, from 0 on.
        seconds: of each run, unless it reaches the caecum [s].
        threads: of the native engine.
        progress: told the simulated time [s].
    """
    limits = Limits(seconds=seconds, perforation_force=_NEVER)
    config = TaskConfig(design=bank.design.name, observation="state", limits=limits)
    task = ScopeTask(config, worlds=seeds, threads=threads, engine=engine, bank=bank)
    seen = task.reset(seeds=list(range(seeds)))
    driver = FollowerDriver(task)
    driver.begin(np.ones(seeds, bool))
    running, diverged = np.ones(seeds, bool), np.zeros(seeds, bool)
    count, sums, peaks = np.zeros(seeds), np.zeros((2, seeds)), np.zeros((2, seeds))
    action = np.zeros((seeds, len(ACTIONS)))
    while running.any():
        action[running] = driver.act(seen)[running]
        done = task.step(action)
        seen, now = done.observation, done.info
        diverged |= running & now["diverged"]
        count += running
        sums += running * np.nan_to_num([np.abs(now["push_force"]), now["wall_force"]])
        reached = now["tip_arc"] / task.bank.lengths[task.case]
        peaks = np.maximum(peaks, running * np.nan_to_num([reached, now["excess"]]))
        running = running & ~done.terminated & ~done.truncated
        progress(float(now["time"].max()))
    task.close()
    return _runs(peaks, sums / count, diverged)


def _runs(
    peaks: Float[np.ndarray, "2 worlds"], means: Float[np.ndarray, "2 worlds"], lost: Bool[np.ndarray, " worlds"]
):
    (reach, looping), (push, wall) = (np.where(lost, np.nan, rows) for rows in (peaks, means))
    return Runs(reach=reach, push=push, wall=wall, looping=looping, diverged=int(lost.sum()))


def compare_insertions(known: Runs | None, found: Mapping[str, Runs | str]) -> list[Agreement]:
    """Mean differences of scores as shares of the native mean, over seeds that neither engine lost.

    Args:
        known: the native engine's; only needed where another ran.
        found: each engine's, or why it is absent.

    Raises:
        InvalidOptionError: when fewer than three seeds are left.
    """
    rows = []
    for engine, runs in found.items():
        for name, (tolerance, reason) in _QUESTIONS.items():
            row = Agreement(f"insertion, mean over seeds: {_NAMES[name]}", engine, tolerance, "of the mean", reason)
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
    scale = float(known[both].mean())
    mean = float(apart.mean()) / scale
    half = float(stats.t.ppf(0.975, count - 1) * stats.sem(apart)) / scale
    return replace(row, difference=mean, interval=(mean - half, mean + half))
