"""The wall that lies in a colon's folder: read when it fits the colon, built when it does not."""

from collections.abc import Callable
from pathlib import Path

from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.store import colon_hash
from haustra.models.wall.pieces.build import Method, build_wall
from haustra.models.wall.pieces.store import METADATA, load_wall, save_wall
from haustra.models.wall.pieces.wall import Wall


def wall_folder(colon_folder: Path, method: Method) -> Path:
    """Where the wall of that method lies."""
    return colon_folder / f"wall-{method}"


def wall_of(
    colon_folder: Path, colon: Colon, method: Method, *, progress: Callable[[str, int, int], None] | None = None
) -> Wall:
    """The wall of `colon` by `method`: the one in its folder, or a new one with default options, which is kept there.

    Raises:
        UnreadableFileError: when a wall is there but damaged.
        WallError: when none can be built.
        OutputError: when a new one cannot be written.
    """
    folder = wall_folder(colon_folder, method)
    if (folder / METADATA).is_file():
        wall = load_wall(folder)
        if colon_hash(colon) in wall.provenance.inputs.values():
            return wall
    wall = build_wall(colon, method=method, progress=progress)
    save_wall(wall, folder)
    return wall
