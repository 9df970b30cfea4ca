"""`haustra bench motion`: whether colons that move hold together, and what the patient around them changes."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, texts, whole


@dataclass(frozen=True)
class BenchMotion:
    """Drive a scope into colons that move, in several postures and patients, and tell whether the wall holds together.

    Leaves motion.md and motion.json; interrupted, motion.json with the colons that are done.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the page and the runs."""
    colons: int = whole(0, 10_000, default=10)
    """Number of grown colons."""
    first_seed: int = whole(0, 2**31 - 1, default=300_000)
    """Seed of the first grown colon; the others follow."""
    seconds: float = number("s", 1.0, 3600.0, default=120.0)
    """Longest run, in simulated time [s]."""
    judged_every: float = number("s", 0.1, 3600.0, default=1.0)
    """Time between two surfaces of a run that are judged, and pictures from the tip that are checked [s]; each takes
    some quarter of a second."""
    driver: tuple[str, ...] = texts(most=10, default=("follower",))
    """Who inserts, each in turn: follower, and insertion, the policy that ships, which knows no gas."""
    processes: int = whole(1, 1000, default=1)
    """Processes that share the colons."""
    patients: tuple[str, ...] = texts(most=100, default=())
    """Names of the patients that each grown colon is put into beside those that they are compared with; all when none
    are given."""
    others: tuple[Path, ...] = ()
    """Folders of other colons, run as they were imaged."""
    add: tuple[Path, ...] = ()
    """Files motion.json of earlier calls, whose runs go on the page before those of this one."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Run, compare, write."""
        import json
        import os

        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

        from haustra.files import prepare_folder, write_atomically, write_json
        from haustra.scripts.bench.motion import (
            COSTLY,
            PATIENTS,
            bench_motion,
            effects,
            soundness,
            step_costs,
            with_base,
        )
        from haustra.scripts.bench.pages.motion_page import motion_page
        from haustra.scripts.console import progress_bar

        folder = prepare_folder(self.output)
        kept = [json.loads(path.read_text(encoding="utf-8"))["runs"] for path in self.add]
        runs = len(with_base(self.patients or tuple(PATIENTS))) * self.colons + len(self.others)
        asked: dict[str, Any] = {"colons": self.colons, "seconds": self.seconds, "judged_every": self.judged_every}
        asked["first_seed"] = self.first_seed
        own: dict[str, Any] = {"patients": self.patients, "others": self.others, "processes": self.processes}

        def keep(rows: list[dict[str, Any]]) -> None:
            """What an interrupted run leaves, for `--add`."""
            write_json(folder / "motion.json", {"runs": [row for given in kept for row in given] + rows})

        with progress_bar("motion", runs * len(self.driver), unit="runs") as advance:
            rows = bench_motion(**asked, **own, drivers=self.driver, progress=advance, keep=keep)
        costs = step_costs([name for name in COSTLY if name in (self.patients or PATIENTS)])
        rows = [row for given in kept for row in given] + rows
        result = {"soundness": soundness(rows), "effects": effects(rows), "costs": costs, "runs": rows}
        page = motion_page(result)
        write_atomically(folder / "motion.md", lambda temporary: temporary.write_text(page, encoding="utf-8"))
        write_json(folder / "motion.json", result)
        return result if self.json else result["soundness"]
