"""Jobs on a Slurm cluster by submitit: the same map from jobs to results, over machines that share the folder."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Literal

from haustra.envs.study.pool import Answers, Claim, JobMap, Lost
from haustra.envs.study.study import Result
from haustra.errors import InvalidOptionError, MissingDependencyError

FOLDER = "slurm"
"""Where submitit keeps its scripts, pickles and logs; only this process and its jobs should be able to write there."""
_JOBS_AT_ONCE = 20
"""Batches in one Slurm job: a job of Slurm costs seconds to start."""
_LOOK_EVERY = 0.5
"""Time between two looks at Slurm's jobs [s]."""


@contextmanager
def slurm_map(
    order: str,
    *,
    folder: Path,
    workers: int,
    batch: int,
    partition: str | None = None,
    cluster: Literal["slurm", "local"] = "slurm",
    minutes: int = 240,
) -> Iterator[JobMap]:
    """A map over Slurm's jobs; what is still running at the end is cancelled.

    Args:
        order: From `worker.order`.
        folder: Of the sweep, on a disk that all machines share.
        workers: Slurm jobs at a time.
        batch: Jobs that the runner likes best.
        partition: Of Slurm.
        cluster: 'local' runs on this machine, for trying out.
        minutes: Longest time of a Slurm job.

    Raises:
        MissingDependencyError: without submitit.
        InvalidOptionError: without Slurm.
    """
    try:
        import submitit
    except ImportError as error:
        raise MissingDependencyError("This needs submitit: install it with 'pip install haustra[slurm]'.") from error
    try:
        executor = submitit.AutoExecutor(folder=folder / FOLDER, cluster=cluster)
    except RuntimeError as error:
        raise InvalidOptionError(
            f"Slurm cannot be used here ({error}): log in to a machine that has sbatch."
        ) from error
    executor.update_parameters(name="haustra-sweep", timeout_min=minutes, cpus_per_task=1)
    if partition is not None:
        executor.update_parameters(slurm_partition=partition)
    running: dict[Any, tuple[int, ...]] = {}
    try:
        yield lambda claim: _answers(executor, running, order, claim, workers=workers, most=batch * _JOBS_AT_ONCE)
    finally:
        for job in running:
            job.cancel()


def _answers(
    executor: Any, running: dict[Any, tuple[int, ...]], order: str, claim: Claim, *, workers: int, most: int
) -> Answers:
    while True:
        while len(running) < workers and (jobs := claim(most)):
            text = json.dumps([job.to_json() for job in jobs])
            running[executor.submit(_answer, order, text)] = tuple(job.id for job in jobs)
        if not running:
            return
        done = [job for job in running if job.done()]
        for job in done:
            ids = running.pop(job)
            try:
                lines = job.result()
            except Exception as error:  # submitit passes on whatever the job or Slurm said
                yield Lost(ids, crashed=ids[0], reason=f"Its Slurm job failed: {' '.join(str(error).split())[:300]}")
                continue
            yield from (Result(**json.loads(line)) for line in lines)
        if not done:
            time.sleep(_LOOK_EVERY)


def _answer(order: str, jobs: str) -> list[str]:
    """What a Slurm job does."""
    from haustra.envs.sim.log import log_to_stderr_only
    from haustra.envs.study.worker import answer_lines

    log_to_stderr_only()
    return list(answer_lines(order, iter([jobs])))
