"""Whole insertions on two backends, world by world under the same seed: how far the means of their scores are apart.

Which way a scope snaps past a fold depends on the last digit, so single runs drift apart and only statistics can agree.
Each seed draws a colon, friction, stiffness of wall and shaft, wires and the angle at the start; the same driver
decides.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, fields, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from jaxtyping import Float

from haustra.envs.sim.warp_setup import use_warp
from haustra.envs.tasks.actions import ACTIONS
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.config import Limits, TaskConfig
from haustra.envs.tasks.drivers import FollowerDriver
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import HaustraError, InvalidOptionError
from haustra.files import prepare_folder, write_atomically
from haustra.provenance import content_hash
from haustra.scripts.bench.accuracy.run import code_state
from haustra.scripts.bench.agreement.row import Agreement
from haustra.scripts.bench.result import mean_interval

_REASON = "backends share one contact law, one follower and each seed's draws; single precision grows into other paths"
_PERFORATED = "the same, of all runs; a perforation ends a run"


@dataclass(frozen=True)
class Runs:
    """Scores of one backend's insertions; one entry a world, NaN where it diverged."""

    reach: Float[np.ndarray, " worlds"]
    """Furthest tip over the colon's length [1]."""
    push: Float[np.ndarray, " worlds"]
    """Mean size of the hand's push [N]."""
    wall: Float[np.ndarray, " worlds"]
    """Mean over time of the largest wall force on one link [N]."""
    torque: Float[np.ndarray, " worlds"]
    """Largest torque of the hand [N m]."""
    looping: Float[np.ndarray, " worlds"]
    """Most scope inside beyond the colon passed [m]."""
    perforated: Float[np.ndarray, " worlds"]
    """1 where the wall force ended the run."""

    @property
    def diverged(self) -> int:
        """How many did."""
        return int(np.isnan(self.reach).sum())


_TOLERANCE = 0.03
"""Tolerance as a share of every mean; of 1 for shares."""
_NAMES = {
    "reach": "reach",
    "push": "mean push",
    "wall": "mean wall force",
    "torque": "peak torque",
    "looping": "peak looping",
    "perforated": "perforations",
}
_PER_PROCESS = 16
"""Worlds that one process steps natively at a time: enough for one look-up of their walls to be worth its call."""

Progress = Callable[[float, str], None]


def insertions(
    bank: ColonSet,
    *,
    backend: str,
    mesentery: bool,
    seeds: int,
    seconds: float,
    processes: int = 1,
    folder: Path | None = None,
    progress: Progress = lambda share, note: None,
) -> Runs | str:
    """Scores of one backend's insertions, from the folder where they are there, or why the backend refuses.

    Args:
        bank: the colons.
        backend: 'native', or another of `haustra.envs.sim.load.NAMES`.
        mesentery: whether the colons move.
        seeds: how many, from 0 on.
        seconds: of each run, unless it reaches the caecum or perforates the wall [s].
        processes: of the native backend; backends on a device take all worlds at once.
        folder: where finished parts are kept and looked for.
        progress: told the share that is done, and what goes on.
    """
    count = _PER_PROCESS if backend == "native" and processes > 1 else seeds
    parts = [range(first, min(first + count, seeds)) for first in range(0, seeds, count)]
    asked = {"backend": backend, "mesentery": mesentery, "seconds": seconds}
    kept = prepare_folder(folder / _state(bank)) if folder else None
    files = {part: kept / _name(part, **asked) for part in parts} if kept else {}
    found = {part: _read(file) for part, file in files.items() if file.is_file()}
    what = f"{backend}, {'on the mesentery' if mesentery else 'fixed'}"

    def take(part: range, runs: Runs) -> None:
        found[part] = runs
        if file := files.get(part):
            write_atomically(file, lambda path: np.savez(path, **asdict(runs)))
        progress(len(found) / len(parts), what)

    waiting = [part for part in parts if part not in found]
    try:
        if len(waiting) < 2:
            for part in waiting:
                take(part, run_seeds(bank, seeds=part, progress=lambda time: progress(time / seconds, what), **asked))
        else:
            plain = replace(bank)  # without what cannot travel
            with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
                answers = {pool.submit(run_seeds, plain, seeds=part, **asked): part for part in waiting}
                for answer in as_completed(answers):
                    take(answers[answer], answer.result())
    except HaustraError as error:
        return str(error)
    return Runs(*(np.concatenate([getattr(found[part], each.name) for part in parts]) for each in fields(Runs)))


def _state(bank: ColonSet) -> str:
    """A hash of the code, of the colons and of how they are stepped."""
    model = repr((bank.design, bank.options)).encode()
    return content_hash(code_state().encode(), *(case.points.tobytes() for case in bank.cases), model)


def _name(part: range, *, backend: str, mesentery: bool, seconds: float) -> str:
    kind = "mesentery" if mesentery else "fixed"
    return f"{backend}-{kind}-{seconds:g}s-{part.start}-{part.stop}.npz"


def _read(file: Path) -> Runs:
    with np.load(file, allow_pickle=False) as arrays:
        return Runs(**{name: arrays[name] for name in arrays.files})


def run_seeds(
    bank: ColonSet,
    *,
    backend: str,
    seeds: Sequence[int],
    seconds: float,
    mesentery: bool = False,
    progress: Callable[[float], None] = lambda time: None,
) -> Runs:
    """Let the lumen follower insert one scope a seed.

    Args:
        bank: the colons.
        backend: 'native', or another of `haustra.envs.sim.load.NAMES`.
        seeds: of each world's draws: colon, friction, stiffness of wall and shaft, wires, angle at the start.
        seconds: of each run, unless it reaches the caecum or perforates the wall [s].
        mesentery: whether the colons move.
        progress: told the simulated time [s].

    Raises:
        UnsupportedSceneError: when the backend cannot honour the colons.
        MissingDependencyError: when what it computes with is not installed.
    """
    limits = Limits(seconds=seconds)
    config = TaskConfig(design=bank.design.name, observation="state", limits=limits, mesentery=mesentery)
    if backend == "warp":
        use_warp()
    worlds = len(seeds)
    task = ScopeTask(config, worlds=worlds, backend=backend, bank=bank)
    seen = task.reset(seeds=list(seeds))
    driver = FollowerDriver(task)
    driver.begin(np.ones(worlds, bool))
    running, (diverged, perforated) = np.ones(worlds, bool), np.zeros((2, worlds), bool)
    count, sums, peaks = np.zeros(worlds), np.zeros((2, worlds)), np.zeros((3, worlds))
    action = np.zeros((worlds, len(ACTIONS)))
    while running.any():
        action[running] = driver.act(seen)[running]
        done = task.step(action)
        seen, now = done.observation, done.info
        diverged |= running & now["diverged"]
        perforated |= running & now["perforated"]
        count += running
        sums += running * np.nan_to_num([np.abs(now["push_force"]), now["wall_force"]])
        reached = now["tip_arc"] / task.bank.lengths[task.case]
        peaks = np.maximum(peaks, running * np.nan_to_num([reached, np.abs(task.seen.torque), now["excess"]]))
        running = running & ~done.terminated & ~done.truncated
        progress(float(now["time"].max()))
    task.close()
    reach, torque, looping = peaks
    push, wall = sums / count
    rows = (reach, push, wall, torque, looping, perforated)
    return Runs(*(np.where(diverged, np.nan, row) for row in rows))


def compare_insertions(
    known: Runs | None, found: Mapping[str, Runs | str], *, mesentery: bool = False
) -> list[Agreement]:
    """Mean differences of scores as shares of the native mean, over seeds that no backend lost; shares as they are.

    Args:
        known: the native backend's; only needed where another ran.
        found: each backend's, or why it is absent.
        mesentery: whether the colons moved.

    Raises:
        InvalidOptionError: when fewer than three seeds are left.
    """
    rows = []
    kind = "on the mesentery" if mesentery else "fixed"
    for backend, runs in found.items():
        for name, said in _NAMES.items():
            perforations = name == "perforated"
            unit, reason = ("of all", _PERFORATED) if perforations else ("of the mean", _REASON)
            row = Agreement(f"insertion, colons {kind}, mean over seeds: {said}", backend, _TOLERANCE, unit, reason)
            if isinstance(runs, str):
                rows.append(row.without(backend, runs))
                break
            assert known is not None
            rows.append(_compared(row, getattr(known, name), getattr(runs, name)))
    return rows


def _compared(row: Agreement, known: np.ndarray, found: np.ndarray) -> Agreement:
    both = np.isfinite(known) & np.isfinite(found)
    apart, count = (found - known)[both], int(both.sum())
    if count < 3:
        raise InvalidOptionError(f"{count} seeds ran on both backends: ask for at least three.")
    scale = 1.0 if row.unit == "of all" else float(known[both].mean())
    mean, low, high = mean_interval(apart)
    return replace(row, difference=mean / scale, interval=(low / scale, high / scale), cases=count)
