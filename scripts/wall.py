"""`haustra wall`."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import tyro

from haustra.fields import number, whole


@dataclass(frozen=True)
class WallBuild:
    """Build the wall of a colon from convex pieces, and measure its error."""

    colon: tyro.conf.Positional[Path]
    """Folder of a colon; the wall is written to its folder wall-METHOD."""
    method: Literal["coacd", "prism"] = "coacd"
    """How the wall is cut into convex pieces: by CoACD's search (coacd), or directly, which is faster (prism)."""
    tolerance_mm: float | None = number("mm", 1e-3, 100.0, default=None)
    """Aim for how deep a piece may stand in the lumen [mm]; 1.5 for coacd and 0.8 for prism when not given."""
    max_error_mm: float | None = number("mm", 1e-3, 100.0, default=None)
    """Refuse a wall whose intrusion (95th percentile) or depth in a neighbouring loop's lumen exceeds this [mm]."""
    thickness_mm: float = number("mm", 0.1, 1000.0, default=30.0)
    """Thickness of the wall: how far pieces reach outwards from the lumen [mm]."""
    workers: int | None = whole(1, 4096, default=None)
    """Number of child processes; as many as there are cores when not given."""
    rays: int = whole(1, 10**8, default=20_000)
    """Number of rays that measure the wall's error."""
    json: bool = False
    """Print one JSON document on stdout."""

    def __call__(self) -> dict:
        """Build, save, and return the measures."""
        from haustra.files import prepare_folder
        from haustra.models.anatomy.store import load_colon
        from haustra.models.wall.pieces.build import build_wall
        from haustra.models.wall.pieces.store import save_wall

        colon = load_colon(self.colon)
        folder = prepare_folder(self.colon / f"wall-{self.method}")
        with wall_bar() as progress:
            wall = build_wall(
                colon,
                method=self.method,
                thickness=self.thickness_mm / 1e3,
                tolerance=None if self.tolerance_mm is None else self.tolerance_mm / 1e3,
                max_error_mm=self.max_error_mm,
                workers=self.workers,
                rays=self.rays,
                progress=progress,
            )
        save_wall(wall, folder)
        return {
            "method": wall.method,
            "pieces": len(wall.pieces),
            "vertices": sum(len(piece.vertices) for piece in wall.pieces),
            **asdict(wall.error),
            **wall.metadata,
            "folder": str(folder),
        }


@contextmanager
def wall_bar() -> Iterator[Callable[[str, int, int], None]]:
    """A progress bar on stderr."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:12}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True)) as shown:
        tasks = {}

        def tell(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = shown.add_task(what, total=total)
            shown.update(tasks[what], completed=done, total=total)

        yield tell
