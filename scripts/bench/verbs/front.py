"""`haustra bench front`: which cells, spheres and time steps buy most accuracy in linear time."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchFront:
    """Drive one script a colon through many cells, spheres and time steps in linear time, and a converged model.

    All colons are stepped at once; finished batches are kept. Some ten processor minutes in full.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for colons, finished batches and front.json."""
    colons: int = whole(1, 100_000, default=10)
    """Number of colons grown from seed 0 on."""
    designs: str = "adult,paediatric"
    """Names of scope designs, separated by commas."""
    settings: str = ""
    """Ways of modelling, separated by commas: presets, or changes as 'shaft_cell=0.03 timestep=0.01'; many if empty."""
    seconds: float = number("s", 0.02, 600.0, default=10.0)
    """Duration of the scripts, in simulated time [s]."""
    processes: int = whole(0, 4096, default=0)
    """Number of processes at a time; as many as there are cores when 0."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure."""
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.children import cores
        from haustra.files import write_json
        from haustra.scripts.bench.accuracy.front import SETTINGS, best, measure_front, modelled
        from haustra.scripts.bench.machine import machine
        from haustra.scripts.bench.verbs.errors import words
        from haustra.scripts.console import progress_bar

        settings = words(self.settings) or SETTINGS
        for setting in settings:
            modelled(setting)
        with progress_bar("front", 1, unit="batches") as advance:
            rows = measure_front(
                self.output,
                colons=self.colons,
                designs=words(self.designs),
                settings=settings,
                seconds=self.seconds,
                processes=self.processes or cores(),
                progress=advance,
            )
        result = {"rows": rows, "machine": machine()}
        write_json(self.output / "front.json", result)
        if self.json:
            return result
        told = {}
        for hung, where in ((False, "fixed"), (True, "mesentery")):
            for row in best([row for row in rows if row["mesentery"] == hung], "push"):
                told[f"{where}, {row['setting']}"] = (
                    f"{row['cost']:.2g} s/s, wall force {100 * row['wall_force']:.2g} %, push "
                    f"{100 * row['push']:.2g} %, tip {row['tip_mm']:.2g} mm"
                )
        return told
