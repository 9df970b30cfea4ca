"""`haustra bench gas`: gas in grown colons against what is published."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchGas:
    """Insufflate the colons of many people, compare volumes, collapse and pressures with what is published, and draw.

    Leaves gas.md, gas.png and gas.json.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the page, the picture and the table."""
    people: int = whole(6, 100_000, default=400)
    """Number of people of each cohort, from seed 0 on."""
    grown: int = whole(2, 10_000, default=20)
    """Number of them whose surface is grown and measured."""
    patients: int = whole(1, 10_000, default=24)
    """Number of virtual patients whose gas is sucked out, to see how much shorter their colons are then."""
    seconds: float = number("s", 0.1, 600.0, default=60.0)
    """Simulated time of each of eight runs of a scope [s]."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure, compare, draw."""
        import os

        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.files import prepare_folder, write_atomically, write_json
        from haustra.scripts.bench.gas import bench_gas, table
        from haustra.scripts.bench.pages.gas_page import draw_gas, gas_page
        from haustra.scripts.console import progress_bar

        folder = prepare_folder(self.output)
        about = {"people": self.people, "grown": self.grown, "patients": self.patients, "seconds": self.seconds}
        with progress_bar("gas", 5, unit="parts") as advance:
            found = bench_gas(**about, progress=advance)
        result = {
            "people": found["people"],
            "rows": table(found["rows"]),
            "collapsed": found["collapsed"],
            "runs": found["runs"],
            "water": found["water"],
            "worlds": found["worlds"],
        }
        write_json(folder / "gas.json", result)
        page = gas_page(result)
        write_atomically(folder / "gas.md", lambda temporary: temporary.write_text(page, encoding="utf-8"))
        result["picture"] = str(draw_gas(folder / "gas.png", found))
        return (
            result if self.json else {row["figure"]: f"{row['grown']} ({row['published']})" for row in result["rows"]}
        )
