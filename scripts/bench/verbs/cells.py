"""`haustra bench cells`: what policies come to with finer and finer scopes."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchCells:
    """Let policies drive the same episodes with finer and finer scopes, and tell who arrives, tears and hurts."""

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for cells.json."""
    drivers: str = "insertion"
    """Names of policies, or their folders, separated by commas."""
    cells: str = ""
    """Names of `haustra.scripts.bench.cells.CELLS`, separated by semicolons; all if empty."""
    colons: int = whole(2, 100_000, default=40)
    """Number of held-out grown colons."""
    seconds: float = number("s", 1.0, 3600.0, default=300.0)
    """Longest episode, in simulated time [s]."""
    threads: int = whole(0, 4096, default=0)
    """Number of threads; as many as there are cores when 0."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure."""
        from haustra.children import cores
        from haustra.errors import InvalidOptionError
        from haustra.files import prepare_folder, write_json
        from haustra.scripts.bench.cells import CELLS, bench_cells
        from haustra.scripts.bench.machine import machine
        from haustra.scripts.bench.verbs.errors import words
        from haustra.scripts.console import progress_bar

        cells = [name.strip() for name in self.cells.split(";") if name.strip()] or list(CELLS)
        if unknown := set(cells) - set(CELLS):
            raise InvalidOptionError(f"Cells {sorted(unknown)} are not known. Known: {'; '.join(CELLS)}.")
        threads = self.threads or cores()
        folder = prepare_folder(self.output)
        with progress_bar("cells", 1, unit="evaluations") as advance:
            rows = bench_cells(
                words(self.drivers),
                cells=cells,
                colons=self.colons,
                seconds=self.seconds,
                threads=threads,
                processes=threads,
                progress=lambda done, total: advance(done, "", total),
            )
        result = {"rows": rows, "machine": machine()}
        write_json(folder / "cells.json", result)
        if self.json:
            return result
        return {
            f"{row['driver']}, {row['cells']}": f"completion {row['completion']:.3g}, P(perforation) "
            f"{row['p_perforation']:.2g}, pain {row['pain']:.2g}, {row['s_per_s']:.2g} s/s"
            for row in rows
        }
