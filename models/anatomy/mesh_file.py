"""Reading surface meshes: cheap checks first, the parser in a child process with limits."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from haustra.errors import InvalidMeshError, UnreadableFileError
from haustra.models.anatomy.child import arrays_from
from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.vtk_cells import joined

FORMATS = (".stl", ".obj", ".ply", ".glb", ".vtk", ".vtp", ".vtu", ".xyz", ".csv")
"""Suffixes of the formats that are read; the last two hold points only."""
MAX_BYTES = 2_000_000_000
"""Larger files are refused: ten million triangles take 500 MB as binary STL."""
MAX_TRIANGLES = 4_000_000
"""More triangles than this are refused, in one file or in all pieces together: an import of a million takes 43 s of
processor time and 1 GB, and CT shows a colon in a tenth of that."""
STL_HEADER, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL's header and of each triangle."""


def read_mesh(file: Path) -> Surface:
    """Read the triangles of a file (STL, OBJ, PLY, GLB, VTK legacy or XML), in the file's own units.

    A file without triangles gives a surface without triangles: its vertices may be a cloud of points.

    Raises:
        UnreadableFileError: when the file is missing, empty, truncated, too large or not a mesh of its kind.
        InvalidMeshError: when it holds coordinates that are not finite, or indices of vertices that it does not hold.
    """
    _check_file(file)
    arrays = arrays_from("haustra.models.anatomy.mesh_parser", file, file.suffix[1:].upper())
    vertices, faces = arrays["vertices"], arrays["faces"]
    if not np.isfinite(vertices).all():
        raise InvalidMeshError(f"'{file}' holds coordinates that are not finite numbers: export it again.")
    if len(faces) > MAX_TRIANGLES:
        raise InvalidMeshError(f"'{file}' has {len(faces)} triangles, more than {MAX_TRIANGLES}: simplify it.")
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise InvalidMeshError(f"'{file}' refers to vertices that it does not hold: export it again.")
    return Surface(vertices=vertices, faces=faces)


def read_pieces(files: Sequence[Path]) -> Surface:
    """Read several files as pieces of one surface, in the units that they share.

    Raises:
        UnreadableFileError: as `read_mesh`.
        InvalidMeshError: as `read_mesh`, or when a file holds no triangles.
    """
    pieces = [read_mesh(file) for file in files]
    for file, piece in zip(files, pieces, strict=True):
        if len(piece.faces) == 0:
            raise InvalidMeshError(f"'{file}' holds no triangles: export the surface, not points or lines.")
    if (count := sum(len(piece.faces) for piece in pieces)) > MAX_TRIANGLES:
        raise InvalidMeshError(f"The pieces have {count} triangles, more than {MAX_TRIANGLES}: simplify them.")
    vertices, faces = joined([(piece.vertices, piece.faces) for piece in pieces])
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
    if suffix == ".glb" and not head.startswith(b"glTF"):
        raise UnreadableFileError(f"'{file}' is not a GLB file: it does not begin with 'glTF'.")
    if suffix in (".vtk", ".vtp", ".vtu") and not head.lstrip().startswith((b"# vtk", b"<?xml", b"<VTKFile")):
        raise UnreadableFileError(f"'{file}' is not a VTK file: neither a legacy nor an XML one begins like this.")
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
