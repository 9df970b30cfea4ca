"""Colons and walls that questions are asked in: grown once, kept beside the answers."""

import tempfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import METADATA, load_colon, save_colon
from haustra.models.wall.pieces.build import Method, build_wall
from haustra.models.wall.pieces.folder import wall_of
from haustra.models.wall.pieces.wall import Wall
from haustra.scripts.bench.accuracy.question import Effort

SEED = 0
"""Seed of the grown colon that most questions are asked in."""


@dataclass(frozen=True)
class Place:
    """A colon in its folder."""

    folder: Path

    @cached_property
    def colon(self) -> Colon:
        """The colon."""
        return load_colon(self.folder)

    def wall(self, method: Method) -> Wall:
        """Its wall by that method at the default tolerance; built first if the folder does not have it."""
        return wall_of(self.folder, self.colon, method)

    def coarse_wall(self) -> Wall:
        """Prisms to the tolerance that is CoACD's default, 1.5 mm; from the cache when it has them."""
        return build_wall(self.colon, method="prism", tolerance=1.5e-3)


def grown(effort: Effort, seed: int = SEED) -> Place:
    """A grown colon, in the folder where answers are kept."""
    folder = (effort.kept or Path(tempfile.mkdtemp())) / "colons" / f"grown-{seed}"
    if not (folder / METADATA).is_file():
        effort.tell(f"growing colon {seed}")
        save_colon(grow_colon(seed=seed), folder)
    return Place(folder)
