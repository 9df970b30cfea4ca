"""`haustra bench motion`: whether colons that move hold together, and what the patient around them changes."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchMotion:
    """Drive a scope into colons that move, in several postures and patients, and tell whether the wall holds together.

    Leaves motion.md and motion.json.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the page and the runs."""
    colons: int = whole(2, 10_000, default=10)
    """Number of grown colons, from seed 300000 on."""
    seconds: float = number("s", 1.0, 3600.0, default=120.0)
    """Longest run, in simulated time [s]."""
    others: tuple[Path, ...] = ()
    """Folders of other colons, run as they were imaged."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Run, compare, write."""
        import os

        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.files import prepare_folder, write_atomically, write_json
        from haustra.scripts.bench.motion import AROUND, bench_motion, effects, soundness
        from haustra.scripts.bench.pages.motion_page import motion_page
        from haustra.scripts.console import progress_bar

        folder = prepare_folder(self.output)
        runs = len(AROUND) * self.colons + len(self.others)
        with progress_bar("motion", runs, unit="runs") as advance:
            rows = bench_motion(colons=self.colons, seconds=self.seconds, others=self.others, progress=advance)
        page = motion_page(rows, seconds=self.seconds)
        write_atomically(folder / "motion.md", lambda temporary: temporary.write_text(page, encoding="utf-8"))
        grown = [row for row in rows if row["colon"].startswith("grown")]
        result = {"soundness": soundness(rows), "effects": effects(grown), "runs": rows}
        write_json(folder / "motion.json", result)
        return result if self.json else result["soundness"]
