"""`haustra sweep`, `optimise` and `sensitivity`: what a study's file asks for."""

from abc import abstractmethod
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from haustra.fields import whole


@dataclass(frozen=True)
class _StudyVerb:
    study: Annotated[str, tyro.conf.Positional]
    """Name of a shipped study (propulsion, scope, scope-mesentery, tracked-reach, tracked-bends,
    policy-stiffness, cohort-causes), or a file that ends in .toml or .yaml."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the study's jobs and results."""
    resume: bool = False
    """Go on with the jobs and results that the folder holds."""
    workers: int | None = whole(1, 100_000, default=None)
    """Number of processes (tasks on Ray, jobs on Slurm) at a time; as many as there are cores when not given."""
    backend: str = "native"
    """What computes: native, or, where the study's question has them, linear, linear-gpu or warp."""
    on: Literal["here", "ray", "slurm"] = "here"
    """Where jobs are computed: on this machine, on a Ray cluster, or by Slurm."""
    address: str | None = None
    """Address of a Ray cluster that runs already; when not given, Ray is started on this machine."""
    partition: str | None = None
    """Slurm partition that jobs go to; Slurm's default when not given."""
    report: bool = True
    """Write report.html at the end."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Run the study."""
        from haustra.children import cores
        from haustra.envs.study.run import Computing
        from haustra.envs.study.study_file import load_study

        study = load_study(self.study)
        computing = Computing(
            backend=self.backend,
            workers=self.workers if self.workers is not None else cores(),
            on=self.on,
            partition=self.partition,
            address=self.address,
        )
        with _bar(study.title) as progress:
            result = self._runner()(study, self.output, computing, resume=self.resume, progress=progress)
        return {"study": study.title, **result, **(_report(self.output) if self.report and self._tabled() else {})}

    def _tabled(self) -> bool:
        """Whether there are tables to report."""
        return True

    @abstractmethod
    def _runner(self) -> Callable[..., dict[str, Any]]:
        """What runs the study."""


@dataclass(frozen=True)
class Sweep(_StudyVerb):
    """Run a study: designs × conditions, on every core or on many machines; nothing is lost when it is stopped."""

    tables: bool = True
    """Write results.csv, results.parquet and the report at the end, which needs polars.
    Otherwise a machine that has polars writes them from the folder later: the same command with --resume."""

    def _tabled(self) -> bool:
        return self.tables

    def _runner(self) -> Callable[..., dict[str, Any]]:
        from functools import partial

        from haustra.envs.study.run import run_sweep

        return partial(run_sweep, tables=self.tables)


@dataclass(frozen=True)
class Optimise(_StudyVerb):
    """Look for a study's best designs, each try informed by those before; nothing is lost when it is stopped."""

    def _runner(self) -> Callable[..., dict[str, Any]]:
        from haustra.envs.study.optimise import run_optimise

        return run_optimise


@dataclass(frozen=True)
class Sensitivity(_StudyVerb):
    """Find how much of each score's variance each variable makes (Sobol's indices), with confidence."""

    def _runner(self) -> Callable[..., dict[str, Any]]:
        from haustra.envs.study.sensitivity import run_sensitivity

        return run_sensitivity


def _report(folder: Path) -> dict[str, str]:
    from haustra.envs.view.report.sweep_report import report_sweep

    return {"report": str(report_sweep(folder)[0])}


@contextmanager
def _bar(title: str):
    """A bar on stderr that takes jobs done, jobs in all, and a note."""
    from haustra.scripts.console import progress_bar

    with progress_bar(title, 1, unit="jobs") as advance:
        yield lambda done, total, note: advance(done, note, total)
