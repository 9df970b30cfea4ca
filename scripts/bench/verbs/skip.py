"""`haustra bench skip`: what leaving things out of a scene gains and changes."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchSkip:
    """Put back what scenes leave out, one thing at a time, and measure what it costs and whether anything changes."""

    colon: Path | None = None
    """Folder of a colon; grown seed 0 with a wall of prisms when not given."""
    seconds: float = number("s", 1.0, 60.0, default=10.0)
    """Simulated time of each replay [s]."""
    repeats: int = whole(1, 10_000, default=5)
    """Number of timings of each pair."""
    quick: bool = False
    """Take 5 s of simulated time and 3 repeats."""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder for skip.json."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure."""
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.files import prepare_folder, write_json
        from haustra.models.devices.scope.library import named_design
        from haustra.scripts.bench.skip import bench_skip
        from haustra.scripts.console import progress_bar

        seconds, repeats = (5.0, 3) if self.quick else (self.seconds, self.repeats)
        folder = prepare_folder(self.output) if self.output else None
        colon, wall = colon_and_wall(self.colon)
        with progress_bar("skip", 1, unit="levers") as advance:
            bench = bench_skip(colon, wall, named_design("adult"), seconds=seconds, repeats=repeats, progress=advance)
        result = bench.to_json()
        if folder:
            write_json(folder / "skip.json", result)
        return result if self.json else {row["left_out"]: _said(row) for row in result["tables"][0]["rows"]}


def colon_and_wall(folder: Path | None):
    """The colon of that folder, or grown seed 0 when there is none, with a wall of prisms."""
    from haustra.models.anatomy.store import load_colon
    from haustra.models.wall.pieces.build import build_wall
    from haustra.models.wall.pieces.folder import wall_of
    from haustra.scripts.wall import wall_bar

    with wall_bar() as tell:
        if folder:
            colon = load_colon(folder)
            return colon, wall_of(folder, colon, "prism", progress=tell)
        from haustra.models.anatomy.grown import grow_colon

        colon = grow_colon(seed=0)
        return colon, build_wall(colon, method="prism", progress=tell)


def _said(row: dict[str, Any]) -> str:
    worst = max(row["tip_change"], row["push_change"], row["wall_change"])
    return f"{row['gain']:.2f} times faster without, scores change by {worst:.1e} ({row['use']})"
