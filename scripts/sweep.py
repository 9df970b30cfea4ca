"""`haustra sweep`: every design of a study under all its conditions."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro


@dataclass(frozen=True)
class Sweep:
    """Run a study: designs × conditions, on every core or on many machines; nothing is lost when it is stopped."""

    study: Annotated[str, tyro.conf.Positional]
    """Name of a shipped study (propulsion), or a file that ends in .toml or .yaml."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for jobs and results."""
    resume: bool = False
    """Go on with what the folder holds."""
    workers: int | None = None
    """Processes (tasks on Ray, jobs on Slurm) at a time; as many as there are cores when not given."""
    engine: str = "native"
    """What computes."""
    on: Literal["here", "ray", "slurm"] = "here"
    """Where: this machine, a Ray cluster, or Slurm."""
    address: str | None = None
    """Of a Ray cluster that runs already; without one, Ray is started here."""
    partition: str | None = None
    """Of Slurm."""
    report: bool = True
    """Write report.html at the end."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Run the study."""
        from haustra.envs.sweep.run import Computing, run_sweep
        from haustra.envs.sweep.study_file import load_study

        study = load_study(self.study)
        computing = Computing(
            engine=self.engine,
            workers=self.workers if self.workers is not None else cores(),
            on=self.on,
            partition=self.partition,
            address=self.address,
        )
        with sweep_bar(study.title) as progress:
            result = run_sweep(study, self.output, computing, resume=self.resume, progress=progress)
        return {"study": study.title, **result}


def cores() -> int:
    """Cores that this process may use."""
    import os

    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def sweep_bar(title: str):
    """A bar on stderr that takes jobs done, jobs in all, and a note."""
    from contextlib import contextmanager

    from haustra.scripts.console import progress_bar

    @contextmanager
    def bar():
        with progress_bar(title, 1, unit="jobs") as advance:
            yield lambda done, total, note: advance(done, note, total)

    return bar()
