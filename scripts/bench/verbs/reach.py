"""`haustra bench reach`: what the whole tracked robot pulls, how far it comes in grown colons, and what stops it."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from haustra.fields import number, several, texts, whole


@dataclass(frozen=True)
class BenchReach:
    """Hold tracked robots by a string in a straight tube, drive them into grown colons, and tell what stops them.

    Leaves reach.md and reach.json; goes on where it was cut short.
    """

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the page and the runs."""
    devices: tuple[str, ...] = texts(most=16, default=("tracked", "tracked-wide"))
    """Tracked robots to drive: names of shipped designs or TOML files; the first is what others are compared with."""
    colons: int = whole(1, 10_000, default=20)
    """Number of grown colons, from seed 300000 on."""
    within: tuple[Path, ...] = ()
    """Folders of imported colons to drive in too, from each of `starts`."""
    starts: tuple[float, ...] = several("m", 0.0, 10.0, least=1, most=100, default=(0.1, 0.225, 0.35, 0.475, 0.6))
    """Where the nose stands there at first: next to these distances from the anus along the colon [m]."""
    seconds: float = number("s", 1.0, 3600.0, default=300.0)
    """Longest run, in simulated time [s]; treads at 150 rpm take 190 s for a colon."""
    workers: int | None = whole(1, 4096, default=None)
    """Number of processes at a time; as many as there are cores when not given."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Run, compare, write."""
        from haustra.children import cores
        from haustra.errors import InvalidOptionError
        from haustra.files import prepare_folder, write_atomically, write_json
        from haustra.models.devices.base import load_device
        from haustra.models.devices.tracked.interface import TrackedRobot
        from haustra.scripts.bench.pages.reach_page import reach_page
        from haustra.scripts.bench.reach import bench_reach, bench_within, held_rows, sizes, summary
        from haustra.scripts.console import progress_bar

        robots = []
        for name in self.devices:
            if not isinstance(robot := load_device(name), TrackedRobot):
                raise InvalidOptionError(f"Device '{name}' is no tracked robot: leave it out.")
            robots.append(robot)
        folder, found = prepare_folder(self.output), {}
        with progress_bar("reach", len(robots) * self.colons, unit="runs") as advance:
            for number_, robot in enumerate(robots):

                def tell(done: int, note: str, before: int = number_ * self.colons) -> None:
                    advance(before + done, note)

                own = {"colons": self.colons, "seconds": self.seconds, "workers": self.workers or cores()}
                rows = bench_reach(robot, folder, progress=tell, **own)
                inside = bench_within(robot, folder, self.within, starts=self.starts, seconds=self.seconds)
                own = {"design": sizes(robot), "summary": summary(rows), "held": held_rows(robot), "runs": rows}
                found[robot.name] = {**own, "within": inside}
        kept = {"seconds": self.seconds, "robots": found}
        page = reach_page(kept)
        write_atomically(folder / "reach.md", lambda temporary: temporary.write_text(page, encoding="utf-8"))
        write_json(folder / "reach.json", kept)
        return found if self.json else {name: each["summary"] for name, each in found.items()}
