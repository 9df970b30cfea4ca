"""`haustra report`: write the report of a run or a sweep again, or compare designs of a sweep."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro


@dataclass(frozen=True)
class Report:
    """Write report.html again from what the folder of a run or a sweep holds."""

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder that `haustra run`, `sweep`, `optimise` or `sensitivity` wrote."""
    compare: tuple[str, ...] = ()
    """Two or more designs of a sweep, by name or number, to put side by side; its best three when not given."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Write the report."""
        from haustra.envs.study.store import FILE
        from haustra.errors import InvalidOptionError

        if (self.folder / FILE).is_file():
            from haustra.envs.view.report.sweep_report import report_sweep

            path, comparison = report_sweep(self.folder, designs=self.compare)
            return {"report": str(path), **({"comparison": comparison} if self.compare else {})}
        if self.compare:
            raise InvalidOptionError(f"'{self.folder}' holds no sweep, so there is nothing to --compare.")

        from haustra.envs.view.report.run_report import report_run

        return {"report": str(report_run(self.folder))}
