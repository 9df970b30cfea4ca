"""Saving a colon to a folder and reading it again."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from haustra.errors import UnreadableFileError
from haustra.files import prepare_folder, write_atomically, write_json
from haustra.models.anatomy.colon import Centreline, Colon, ColonSegment, Lesion, Surface
from haustra.provenance import Provenance, content_hash
from haustra.reading import LARGEST_RECORD, read_arrays, read_document

FORMAT_VERSION = 1
"""Raised when a folder written before can no longer be read."""
METADATA, ARRAYS, PICTURE = "colon.json", "colon.npz", "lumen.stl"
"""What a colon's folder holds: names and numbers, arrays in SI units, and the surface in mm for other programs."""
SHAPES = {
    "vertices": (None, 3),
    "faces": (None, 3),
    "points": (None, 3),
    "arc": (None,),
    "frames": (None, 3, 3),
    "radius": (None, None),
}


def colon_hash(colon: Colon) -> str:
    """Content hash of everything about a colon that shapes a simulation."""
    numbers = [np.ascontiguousarray(array) for array in _arrays(colon).values()]
    segments = json.dumps([asdict(segment) for segment in colon.segments])
    shapes = json.dumps([array.shape for array in numbers])
    return content_hash(segments.encode(), shapes.encode(), *(array.tobytes() for array in numbers))


def save_colon(colon: Colon, folder: Path) -> Path:
    """Write a colon into `folder`; a colon that was there is replaced file by file, the metadata last.

    Raises:
        OutputError: when the folder cannot be written.
    """
    prepare_folder(folder)
    write_atomically(folder / ARRAYS, lambda path: np.savez_compressed(path, **_arrays(colon)))
    write_atomically(folder / PICTURE, lambda path: _write_stl(colon.lumen, path))
    write_json(
        folder / METADATA,
        {
            "format": "haustra colon",
            "format_version": FORMAT_VERSION,
            "name": colon.name,
            "hash": colon_hash(colon),
            "segments": [asdict(segment) for segment in colon.segments],
            "landmarks": dict(colon.landmarks),
            "warnings": list(colon.warnings),
            "lesions": [asdict(lesion) for lesion in colon.lesions],
            "provenance": colon.provenance.to_json(),
        },
    )
    return folder


def load_colon(folder: Path) -> Colon:
    """Read a colon that `save_colon` wrote.

    Raises:
        UnreadableFileError: when the folder holds no colon, or one that is damaged or of another version.
    """
    folder = Path(folder)
    metadata = _read_metadata(folder)
    arrays = _read_arrays(folder / ARRAYS)
    try:
        colon = Colon(
            name=str(metadata["name"]),
            lumen=Surface(vertices=arrays["vertices"], faces=arrays["faces"]),
            centreline=Centreline(points=arrays["points"], arc=arrays["arc"], frames=arrays["frames"]),
            radius=arrays["radius"],
            segments=tuple(ColonSegment(**segment) for segment in metadata["segments"]),
            provenance=Provenance(**metadata["provenance"]),
            landmarks=dict(metadata["landmarks"]),
            warnings=tuple(metadata["warnings"]),
            lesions=tuple(_lesion(entry) for entry in metadata.get("lesions", ())),
        )
        expected = metadata["hash"]
    except (KeyError, TypeError, AttributeError) as error:
        raise UnreadableFileError(f"'{folder / METADATA}' is incomplete ({error}): make the colon again.") from error
    if colon_hash(colon) != expected:
        raise UnreadableFileError(f"The files in '{folder}' do not belong together: make the colon again.")
    return colon


def _lesion(entry: dict) -> Lesion:
    return Lesion(**{**entry, "position": tuple(entry["position"])})


def _arrays(colon: Colon) -> dict[str, Any]:
    line = colon.centreline
    return {
        "vertices": colon.lumen.vertices.astype("<f8"),
        "faces": colon.lumen.faces.astype("<i4"),
        "points": line.points.astype("<f8"),
        "arc": line.arc.astype("<f8"),
        "frames": line.frames.astype("<f8"),
        "radius": colon.radius.astype("<f8"),
    }


def _read_metadata(folder: Path) -> dict:
    path = folder / METADATA
    if not path.is_file():
        raise UnreadableFileError(
            f"'{folder}' holds no colon ({METADATA} is missing): make one with 'haustra colon import' or 'colon grow'."
        )
    metadata = read_document(path, "colon", largest=LARGEST_RECORD)
    if not isinstance(metadata, dict) or metadata.get("format") != "haustra colon":
        raise UnreadableFileError(f"'{path}' does not describe a colon: make the colon again.")
    if metadata.get("format_version") != FORMAT_VERSION:
        raise UnreadableFileError(
            f"'{path}' has format version {metadata.get('format_version')}, this haustra reads {FORMAT_VERSION}: "
            "make the colon again."
        )
    return metadata


def _read_arrays(path: Path) -> dict[str, np.ndarray]:
    arrays = read_arrays(path, SHAPES)
    for name, shape in SHAPES.items():
        array = arrays[name]
        fits = array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape, strict=True))
        if not fits or not np.isfinite(array).all() or array.size == 0:
            raise UnreadableFileError(f"'{path}' holds a damaged array '{name}': make the colon again.")
    if len({len(arrays[name]) for name in ("points", "arc", "frames", "radius")}) > 1:
        raise UnreadableFileError(f"'{path}' holds stations of unequal number: make the colon again.")
    faces = arrays["faces"]
    if not np.issubdtype(faces.dtype, np.integer) or faces.min() < 0 or faces.max() >= len(arrays["vertices"]):
        raise UnreadableFileError(f"'{path}' refers to vertices that it does not hold: make the colon again.")
    return arrays


def _write_stl(surface: Surface, path: Path) -> None:
    """Binary STL in mm, since that is what other programs take an STL to be in."""
    corners = surface.vertices[surface.faces] * 1e3
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    record = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["normal"], record["corners"] = normal, corners
    with path.open("wb") as stream:
        stream.write(b"lumen surface in mm, written by haustra".ljust(80))
        stream.write(np.uint32(len(record)).tobytes())
        stream.write(record.tobytes())
