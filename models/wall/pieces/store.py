"""Saving a wall to a folder and reading it again."""

from dataclasses import asdict
from pathlib import Path

import numpy as np

from haustra.errors import UnreadableFileError
from haustra.files import prepare_folder, write_atomically, write_json
from haustra.models.wall.pieces.wall import Wall, WallAccuracy, WallPiece
from haustra.provenance import Provenance
from haustra.reading import LARGEST_RECORD, read_arrays, read_document

FORMAT_VERSION = 1
"""Raised when a folder written before can no longer be read."""
METADATA, ARRAYS = "wall.json", "pieces.npz"


def save_wall(wall: Wall, folder: Path) -> Path:
    """Write a wall into `folder`; one that was there is replaced, the metadata last.

    Raises:
        OutputError: when the folder cannot be written.
    """
    prepare_folder(folder)
    arrays = {
        "vertices": np.concatenate([piece.vertices for piece in wall.pieces]),
        "counts": np.array([len(piece.vertices) for piece in wall.pieces], np.int64),
        "arcs": np.array([(piece.start, piece.end) for piece in wall.pieces]),
    }
    write_atomically(folder / ARRAYS, lambda path: np.savez_compressed(path, **arrays))
    write_json(
        folder / METADATA,
        {
            "format": "haustra wall",
            "format_version": FORMAT_VERSION,
            "method": wall.method,
            "pieces": len(wall.pieces),
            "error": asdict(wall.error),
            "metadata": dict(wall.metadata),
            "provenance": wall.provenance.to_json(),
        },
    )
    return folder


def load_wall(folder: Path) -> Wall:
    """Read a wall that `save_wall` wrote.

    Raises:
        UnreadableFileError: when a file is missing, damaged or of another format.
    """
    for name in (METADATA, ARRAYS):
        if not (folder / name).is_file():
            raise UnreadableFileError(f"No wall in '{folder}': '{name}' is missing. Build one with 'haustra wall'.")
    try:
        known = read_document(folder / METADATA, "wall", largest=LARGEST_RECORD)
        if known.get("format") != "haustra wall" or known.get("format_version") != FORMAT_VERSION:
            raise UnreadableFileError(
                f"'{folder / METADATA}' is no wall that this version reads: build the wall again."
            )
        vertices, counts, arcs = read_arrays(folder / ARRAYS, ("vertices", "counts", "arcs")).values()
        parts = np.split(vertices, np.cumsum(counts)[:-1])
        if counts.sum() != len(vertices) or len(parts) != len(arcs) or not np.isfinite(vertices).all():
            raise ValueError("its arrays do not fit together")
        return Wall(
            method=known["method"],
            pieces=tuple(
                WallPiece(np.ascontiguousarray(part), float(start), float(end))
                for part, (start, end) in zip(parts, arcs, strict=True)
            ),
            error=WallAccuracy(**known["error"]),
            provenance=Provenance(**known["provenance"]),
            metadata=known["metadata"],
        )
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise UnreadableFileError(f"The wall in '{folder}' is damaged ({error}): build it again.") from error
