"""Reading surface meshes: cheap checks first, the parser in a child process with limits."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from haustra.errors import InvalidMeshError, UnreadableFileError
from haustra.models.anatomy.colon import Surface

FORMATS = (".stl", ".obj", ".ply")
"""Suffixes of the formats that are read."""
MAX_BYTES = 2_000_000_000
"""Larger files are refused: ten million triangles take 500 MB as binary STL."""
MAX_TRIANGLES = 12_000_000
"""More triangles than this do not fit into the memory of a small machine."""
PARSE_SECONDS = 120
"""A parser that takes longer hangs: five million triangles load in 20 s."""
STL_HEADER, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL's header and of each triangle."""


def read_mesh(file: Path) -> Surface:
    """Read the triangles of an STL, OBJ or PLY file, in the file's own units.

    Raises:
        UnreadableFileError: when the file is missing, empty, truncated, too large or not a mesh of its kind.
        InvalidMeshError: when it holds no triangles, or coordinates that are not finite.
    """
    _check_file(file)
    with tempfile.TemporaryDirectory() as scratch:
        target = Path(scratch) / "mesh.npz"
        command = [sys.executable, "-m", "haustra.models.anatomy.mesh_parser", os.fspath(file.resolve()), str(target)]
        try:
            child = subprocess.run(command, capture_output=True, text=True, timeout=PARSE_SECONDS, check=False)
        except subprocess.TimeoutExpired as error:
            raise UnreadableFileError(
                f"'{file}' took more than {PARSE_SECONDS} s to read: simplify the mesh, or convert it to binary STL."
            ) from error
        if child.returncode != 0 or not target.is_file():
            reason = (child.stderr.strip().splitlines() or ["the parser crashed"])[-1]
            raise UnreadableFileError(
                f"'{file}' cannot be read as {file.suffix[1:].upper()} ({reason[:160]}): export it again."
            )
        with np.load(target, allow_pickle=False) as arrays:
            vertices, faces = arrays["vertices"], arrays["faces"]
    if len(faces) == 0:
        raise InvalidMeshError(f"'{file}' holds no triangles: export the surface, not points or lines.")
    if not np.isfinite(vertices).all():
        raise InvalidMeshError(f"'{file}' holds coordinates that are not finite numbers: export it again.")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InvalidMeshError(f"'{file}' refers to vertices that it does not hold: export it again.")
    return Surface(vertices=vertices, faces=faces)


def _check_file(file: Path) -> None:
    suffix = file.suffix.lower()
    if file.is_dir():
        raise UnreadableFileError(f"'{file}' is a folder: name a mesh file ({', '.join(FORMATS)}).")
    try:
        size = file.stat().st_size
        with file.open("rb") as stream:
            head = stream.read(STL_HEADER)
    except OSError as error:
        raise UnreadableFileError(f"Cannot read '{file}': {error.strerror or error}.") from error
    if suffix not in FORMATS:
        raise UnreadableFileError(f"'{file}' is not a mesh by its name: known formats are {', '.join(FORMATS)}.")
    if size == 0:
        raise UnreadableFileError(f"'{file}' is empty: export the mesh again.")
    if size > MAX_BYTES:
        raise UnreadableFileError(f"'{file}' has {size / 1e9:.1f} GB, more than {MAX_BYTES / 1e9:.0f}: simplify it.")
    if suffix == ".ply" and not head.startswith(b"ply"):
        raise UnreadableFileError(f"'{file}' is not a PLY file: it does not begin with 'ply'.")
    if suffix == ".stl":
        _check_stl(file, head, size)


def _check_stl(file: Path, head: bytes, size: int) -> None:
    """A binary STL says how long it is; an ASCII one begins with 'solid' and names facets."""
    count = int.from_bytes(head[80:84], "little") if len(head) == STL_HEADER else -1
    if size == STL_HEADER + STL_TRIANGLE * count:
        if count > MAX_TRIANGLES:
            raise UnreadableFileError(f"'{file}' has {count} triangles, more than {MAX_TRIANGLES}: simplify it.")
        return
    if head.lstrip().lower().startswith(b"solid"):
        with file.open("rb") as stream:
            if b"facet" in stream.read(4096).lower():
                _check_ascii_end(file, size)
                return
    if 0 < count <= MAX_BYTES // STL_TRIANGLE and STL_HEADER < size < STL_HEADER + STL_TRIANGLE * count:
        held = (size - STL_HEADER) // STL_TRIANGLE
        raise UnreadableFileError(f"'{file}' is truncated: it holds {held} of {count} triangles. Copy it again.")
    raise UnreadableFileError(f"'{file}' is not an STL file: neither its length nor its beginning fits.")


def _check_ascii_end(file: Path, size: int) -> None:
    with file.open("rb") as stream:
        stream.seek(max(0, size - 4096))
        if b"endsolid" not in stream.read().lower():
            raise UnreadableFileError(f"'{file}' is truncated: its last line is not 'endsolid'. Copy it again.")
