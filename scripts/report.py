"""`haustra report`: write a run's report again."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Report:
    """Write report.html again from what a run's folder holds."""

    run: Annotated[Path, tyro.conf.Positional]
    """Folder that `haustra run` wrote."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, str]:
        """Write the report."""
        from haustra.envs.report.run_report import report_run

        return {"report": str(report_run(self.run))}
