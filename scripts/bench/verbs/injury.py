"""`haustra bench injury`: perforation, bleeding and pain in grown colons beside what is published."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchInjury:
    """Drive a scope into held-out grown colons, on their mesentery and fixed, and tell what that does to them.

    Leaves injury.md, injury.png, injury-map.png and injury.json.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the page, the pictures and the runs."""
    colons: int = whole(2, 10_000, default=10)
    """Number of colons, from seed 300000 on."""
    seconds: float = number("s", 1.0, 3600.0, default=120.0)
    """Longest run, in simulated time [s]."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Run, compare, draw."""
        import os

        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.files import prepare_folder, write_atomically, write_json
        from haustra.scripts.bench.injury import bench_injury, table
        from haustra.scripts.bench.pages.injury_page import draw_example, draw_injury, injury_page
        from haustra.scripts.console import progress_bar

        folder = prepare_folder(self.output)
        with progress_bar("injury", 2 * self.colons, unit="runs") as advance:
            found = bench_injury(colons=self.colons, seconds=self.seconds, progress=advance)
        page = injury_page(found)
        write_atomically(folder / "injury.md", lambda temporary: temporary.write_text(page, encoding="utf-8"))
        pictures = draw_injury(folder / "injury.png", found), draw_example(folder / "injury-map.png", found)
        result = {"rows": table(found["rows"]), "runs": found["rows"], "pictures": [str(path) for path in pictures]}
        write_json(folder / "injury.json", result)
        if self.json:
            return result
        return {row["figure"]: f"{row['on the mesentery']}; fixed {row['fixed']}" for row in result["rows"]}
