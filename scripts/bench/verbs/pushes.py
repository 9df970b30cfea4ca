"""`haustra bench pushes`: whether a scope's tip stays inside a colon."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from haustra.fields import whole


@dataclass(frozen=True)
class BenchPushes:
    """Push a scope's tip about inside a colon, with up to 20 N and 0.3 m/s, and count how often it gets out."""

    colon: Path
    """Folder of a colon."""
    wall: Literal["planes", "coacd", "prism"] = "planes"
    """What holds it: tangent planes, or convex pieces."""
    count: int = whole(1, 10**9, default=1000)
    """Number of pushes."""
    seed: int = whole(0, 2**63 - 1, default=0)
    """Seed of the places, directions and forces."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Push, and say how far outside the tip ended."""
        from haustra.models.anatomy.store import load_colon
        from haustra.models.wall.pieces.folder import wall_of
        from haustra.scripts.bench.pushes import random_pushes, summary
        from haustra.scripts.console import progress_bar

        colon = load_colon(self.colon)
        wall = None if self.wall == "planes" else wall_of(self.colon, colon, self.wall)
        with progress_bar("push", self.count, unit="pushes") as advance:
            pushes = random_pushes(
                colon, wall, count=self.count, seed=self.seed, progress=lambda done: advance(done, "")
            )
        return {"colon": colon.name, "wall": self.wall, "seed": self.seed, **summary(pushes)}
