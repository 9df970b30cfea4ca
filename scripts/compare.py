"""`haustra compare`: devices in the same patients, side by side."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class Compare:
    """Let devices go as far as they come in the same patients; tell how far, at what cost, and what stopped them."""

    devices: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Names of shipped devices (scope, tracked, vine, capsule, inchworm and others), or TOML files; two or more."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("comparison")
    """Folder for runs, tables, pictures and the page."""
    cohort: str = "quick"
    """Patients: smoke (2), quick (4), standard (20) or large (100)."""
    seconds: float = number("s", 0.02, 36_000.0, default=240.0)
    """Longest run of a device in a patient, in simulated time [s]."""
    patience: float = number("s", 1.0, 3600.0, default=40.0)
    """A device that comes no further for so long is stuck [s]."""
    resume: bool = False
    """Go on with the runs that the folder holds."""
    workers: int | None = whole(1, 4096, default=None)
    """Number of processes at a time; as many as there are cores when not given."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Run what is missing, then write tables and page."""
        from haustra.children import cores
        from haustra.envs.study.compare import CompareOptions, compared, comparison
        from haustra.envs.study.run import Computing, run_sweep
        from haustra.envs.view.report.compare_report import report_comparison
        from haustra.scripts.console import progress_bar

        options = CompareOptions(seconds=self.seconds, patience=self.patience)
        study = comparison(self.devices, self.cohort, options)
        computing = Computing(workers=self.workers or cores())
        with progress_bar("compare", 1, unit="runs") as advance:

            def tell(done: int, total: int, note: str) -> None:
                advance(done, note, total)

            run_sweep(study, self.output, computing, resume=self.resume, tables=False, progress=tell)
        found = compared(self.output)
        told = {name: found[name] for name in ("devices", "pairs", "lost")}
        return {**told, "files": report_comparison(self.output, found)}
