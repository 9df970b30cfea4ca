"""`haustra bench grown`: many grown colons held against published anatomy."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import whole


@dataclass(frozen=True)
class BenchGrown:
    """Grow and measure many colons, compare them with the sources, and draw both.

    Each case is kept as it is finished, so that an interrupted run goes on where it stopped.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the cases, comparison.json and grown-anatomy.png."""
    seeds: int = whole(2, 1_000_000, default=200)
    """Number of colons of the Japanese cohort, from seed 0 on."""
    us_seeds: int = whole(0, 1_000_000, default=60)
    """Number of colons of the US cohort, whose flexures are published."""
    colons: tuple[Path, ...] = ()
    """Folders of imported colons to draw beside them; keep such a picture as you keep the colons' data."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Measure, compare, draw."""
        import os

        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.files import prepare_folder, write_json
        from haustra.models.anatomy.measures import anatomy_of
        from haustra.models.anatomy.store import load_colon
        from haustra.provenance import Provenance
        from haustra.scripts.bench.grown import compare, measure_cases
        from haustra.scripts.bench.pages.grown_figure import draw
        from haustra.scripts.console import progress_bar

        folder = prepare_folder(self.output)
        real = {colon.name: anatomy_of(colon) for colon in map(load_colon, self.colons)}
        with progress_bar("grown colons", self.seeds + self.us_seeds, unit="colons") as advance:
            rows = measure_cases(folder, range(self.seeds), progress=advance)
            rows += measure_cases(
                folder,
                range(self.us_seeds),
                cohort="us-ctc",
                progress=lambda done, note: advance(self.seeds + done, note),
            )
        grown = [row for row in rows if "failed" not in row]
        verdicts = compare(grown)
        result = {
            "cases": len(rows),
            "failed": {f"{row['cohort']} {row['seed']}": row["failed"] for row in rows if "failed" in row},
            "self_intersecting": [f"{row['cohort']} {row['seed']}" for row in grown if row["crossings"]],
            "passed": sum(verdict.passed for verdict in verdicts),
            "compared": len(verdicts),
            "not_passed": [_line(verdict) for verdict in verdicts if verdict.shown and not verdict.passed],
            "not_shown": [_line(verdict) for verdict in verdicts if not verdict.shown],
        }
        write_json(
            folder / "comparison.json",
            {
                **result,
                "verdicts": [_entry(verdict) for verdict in verdicts],
                "provenance": Provenance(
                    inputs={}, configuration={"seeds": self.seeds, "us_seeds": self.us_seeds}
                ).to_json(),
            },
        )
        picture = draw(folder / "grown-anatomy.png", grown, verdicts, real)
        return {**result, "picture": str(picture)}


def _line(verdict) -> str:
    figure = verdict.published
    return f"{figure.measure} ({figure.group or 'all'}): {figure.rule}, {verdict.mean:.4g}, source: {figure.source}"


def _entry(verdict) -> dict[str, Any]:
    """A verdict as JSON values; an open end of an interval is null."""
    from dataclasses import asdict

    entry = asdict(verdict)
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value for name, value in entry.items()
    }
