"""`haustra bench stability`: whether simulations stay stable, whatever is asked of them."""

import math
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class BenchStability:
    """Try random settings, shocks, NaN and Inf in inputs, laws of physics, long runs: does anything blow up?"""

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("bench-stability")
    """Folder of results; an interrupted run goes on in the same one."""
    only: str = ""
    """Parts to run, separated by commas: conservation, nan, shocks, step, escapes, ranges, long, moving, linear; all
    if empty."""
    quick: bool = False
    """Make fewer and shorter runs: minutes instead of hours."""
    workers: int = whole(1, 256, default=1)
    """Number of child processes of the parts that have many independent runs."""
    minutes: float | None = number("min", 0.01, 1e6, default=None)
    """Time after which no further run begins [min]; what is missing is said, and the same command goes on from there.
    Parts without independent runs (conservation, nan, moving, shocks and long runs of linear) are not cut short."""
    colon: Path | None = None
    """Folder of a colon to push a tip about in besides the grown one."""
    seed: int = whole(0, 2**63 - 1, default=0)
    """Seed of all random draws."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Run the parts and write stability.json."""
        from haustra.files import prepare_folder, write_json
        from haustra.scripts.bench.result import Bench
        from haustra.scripts.bench.stability.bench import PARTS, stability
        from haustra.scripts.bench.stability.part import RunOptions
        from haustra.scripts.console import progress_bar

        names = [name.strip() for name in self.only.split(",") if name.strip()]
        order = RunOptions(
            folder=prepare_folder(self.output),
            quick=self.quick,
            workers=self.workers,
            deadline=math.inf if self.minutes is None else time.monotonic() + 60 * self.minutes,
            seed=self.seed,
            colon=self.colon,
        )
        target = self.output / "stability.json"

        def keep(so_far: Bench) -> None:
            write_json(target, so_far.to_json())

        asked = names or list(PARTS)
        with progress_bar("stability", len(asked), unit="parts") as advance:
            found = stability(
                order,
                names,
                lambda part, done, note: advance(asked.index(part) + done, f"{part} {note}"),
                keep=keep,
            )
        result = found.to_json()
        if self.json:
            return result
        marks = {True: "met", False: "NOT MET"}
        criteria = {
            one.what: f"{one.measured:.3g} {one.unit} ({one.sense} {one.bound:g}: {marks[one.met]})"
            for one in found.criteria
        }
        return {**criteria, "extent": found.summary[0], "written": str(target)}
