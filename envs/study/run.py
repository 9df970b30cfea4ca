"""Running a study: designs × conditions → rows."""

import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from haustra.envs.study.export import export, require_polars
from haustra.envs.study.pool import JobMap, Lost, WorkerPool
from haustra.envs.study.questions import Backend, find_backend
from haustra.envs.study.sampling import designs_of, jobs_of
from haustra.envs.study.store import SweepStore, open_store
from haustra.envs.study.study import Result, Study
from haustra.envs.study.worker import order
from haustra.errors import InvalidOptionError

Progress: TypeAlias = Callable[[int, int, str], None]
"""Told how many jobs are done, of how many, and a note."""
On = Literal["here", "ray", "slurm"]
DONE = ("finished", "failed", "diverged")
"""States in which a job needs no further work."""
LOG = "workers.log"


@dataclass(frozen=True)
class Computing:
    """Who computes: nothing of this changes a row."""

    backend: str = "native"
    workers: int = 1
    """Processes here, tasks at a time on Ray, jobs at a time on Slurm."""
    on: On = "here"
    partition: str | None = None
    """Partition of Slurm; Slurm's default when None."""
    address: str | None = None
    """Address of a Ray cluster that runs already; a local one is started when None."""


def run_sweep(
    study: Study,
    folder: Path,
    computing: Computing | None = None,
    *,
    resume: bool = False,
    tables: bool = True,
    progress: Progress = lambda done, total, note: None,
) -> dict[str, object]:
    """Answer every job of a study, and write results.csv, results.parquet and their data dictionary.

    Without `tables` nothing is written but the store, and polars is not needed.

    Killed at any moment, it goes on with `resume`, and ends with the same rows as if nothing had happened.

    Returns:
        Counts of the jobs by state, and the files written.

    Raises:
        InvalidStudyError: when the study asks for more than its budget.
        InvalidOptionError: when the folder holds something else, or `computing` cannot be honoured.
        MissingDependencyError: without polars, or without what `computing` needs.
        OutputError: when the folder cannot be written: what was recorded is kept.
    """
    computing = computing or Computing()
    if tables:
        require_polars()
    backend = find_backend(study.question, computing.backend)
    with (
        open_store(folder, study, lambda: jobs_of(study, designs_of(study)), kind="sweep", resume=resume) as store,
        job_map(study, folder, computing, tell=lambda note: progress(0, 1, note)) as answer,
    ):
        store.begin_session(backend=computing.backend, pool=computing.on, alike=backend.alike)
        answer_all(store, answer, progress=progress)
        counts = store.counts()
        return {**{state: counts[state] for state in DONE}, **(export(store) if tables else {})}


def answer_all(store: SweepStore, answer: JobMap, *, progress: Progress = lambda done, total, note: None) -> None:
    """Let a map answer every job of a store that waits; the only place where results are recorded."""
    counts, begun, fresh = store.counts(), time.monotonic(), 0
    total = sum(counts.values())
    with closing(_closable(answer(store.claim))) as answers:
        for result in answers:
            if isinstance(result, Lost):
                store.give_back(result.jobs, crashed=result.crashed, reason=result.reason, alone=result.alone)
                counts = store.counts()
            elif store.record(result):
                counts[result.state] += 1
                fresh += 1
            progress(total - _waiting(counts, total), total, _note(counts, fresh / (time.monotonic() - begun + 1e-9)))


def _waiting(counts: dict[str, int], total: int) -> int:
    return total - sum(counts[state] for state in DONE)


def _note(counts: dict[str, int], rate: float) -> str:
    """Rate, and what went wrong so far."""
    wrong = [f"{counts[state]} {state}" for state in ("failed", "diverged") if counts[state]]
    return ", ".join([f"{rate:.1f}/s" if rate >= 1 else f"{60 * rate:.1f}/min", *wrong])


def _closable(answers: Iterable[Result | Lost]) -> Generator[Result | Lost, None, None]:
    yield from answers


@contextmanager
def job_map(
    study: Study, folder: Path, computing: Computing, *, tell: Callable[[str], None] = lambda note: None
) -> Iterator[JobMap]:
    """The map from jobs to rows that `computing` names; what jobs share is in the folder before it is used.

    Raises:
        InvalidOptionError: when it cannot be honoured.
        MissingDependencyError: when the package that it needs is not installed.
    """
    backend: Backend = find_backend(study.question, computing.backend)
    backend.prepare(study, folder, tell)
    asked = order(study, computing.backend, folder.resolve())
    if computing.on == "here":
        pool = WorkerPool(
            asked,
            workers=min(computing.workers, backend.most_workers or computing.workers),
            batch=backend.batch,
            log=folder / LOG,
            job_seconds=study.budget.job_seconds,
            together=backend.together,
        )
        try:
            yield pool
        finally:
            pool.close()
    elif computing.on == "ray":
        from haustra.envs.study.on_ray import ray_map

        with ray_map(asked, workers=computing.workers, batch=backend.batch, address=computing.address) as found:
            yield found
    elif computing.on == "slurm":
        from haustra.envs.study.on_slurm import slurm_map

        with slurm_map(
            asked, folder=folder, workers=computing.workers, batch=backend.batch, partition=computing.partition
        ) as found:
            yield found
    else:
        raise InvalidOptionError(f"Nothing runs on '{computing.on}'. Known: here, ray, slurm.")
