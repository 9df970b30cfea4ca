"""What VTK's two file formats share: number types, and cells cut into triangles."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

TYPES = {
    "float": "f4",
    "double": "f8",
    "char": "i1",
    "unsigned_char": "u1",
    "short": "i2",
    "unsigned_short": "u2",
    "int": "i4",
    "unsigned_int": "u4",
    "long": "i8",
    "unsigned_long": "u8",
    "vtkidtype": "i8",
    "vtktypeint64": "i8",
    "Float32": "f4",
    "Float64": "f8",
    "Int8": "i1",
    "UInt8": "u1",
    "Int16": "i2",
    "UInt16": "u2",
    "Int32": "i4",
    "UInt32": "u4",
    "Int64": "i8",
    "UInt64": "u8",
}
"""Names of number types in legacy and XML files, as numpy knows them."""
TRIANGLE, STRIP, POLYGON, QUAD = 5, 6, 7, 9
"""Cell types of unstructured grids that are pieces of a surface."""


@dataclass(frozen=True)
class Cells:
    """Cells as VTK stores them."""

    connectivity: Int[np.ndarray, " corners"]
    """Vertex indices of all cells, one after another."""
    offsets: Int[np.ndarray, " bounds"]
    """Where each cell begins, and the end of the last."""
    strips: bool = False
    """Whether each cell is a strip of triangles rather than a polygon."""


def triangles(cells: Cells) -> Int[np.ndarray, "triangles 3"]:
    """Every polygon as a fan of triangles, every strip as its triangles.

    Raises:
        ValueError: when the offsets do not fit the connectivity.
    """
    begin, size = cells.offsets[:-1], np.diff(cells.offsets)
    if len(size) == 0:
        return np.empty((0, 3), np.int64)
    if cells.offsets[0] < 0 or size.min() < 0 or cells.offsets[-1] > len(cells.connectivity):
        raise ValueError("the cells do not fit their list of vertices")
    found = []
    for n in np.unique(size[size >= 3]):
        corners = cells.connectivity[begin[size == n][:, None] + np.arange(n)]
        for k in range(1, n - 1):
            if not cells.strips:
                found.append(corners[:, [0, k, k + 1]])
            else:  # every other triangle of a strip is wound the other way
                found.append(corners[:, [k - 1, k, k + 1] if k % 2 else [k, k - 1, k + 1]])
    return np.concatenate(found) if found else np.empty((0, 3), np.int64)


def surface_cells(
    connectivity: Int[np.ndarray, " corners"], offsets: Int[np.ndarray, " bounds"], types: Int[np.ndarray, " cells"]
) -> Int[np.ndarray, "triangles 3"]:
    """Triangles of the cells of an unstructured grid that are pieces of a surface; solid cells are left out.

    Raises:
        ValueError: when the lists do not fit each other.
    """
    if len(types) != len(offsets) - 1:
        raise ValueError("the cells do not fit their list of types")
    found = []
    for wanted, strips in (((TRIANGLE, POLYGON, QUAD), False), ((STRIP,), True)):
        pick = np.isin(types, wanted)
        size = np.diff(offsets)[pick]
        where = np.repeat(offsets[:-1][pick], size) + np.arange(size.sum()) - np.repeat(np.cumsum(size) - size, size)
        if len(where) and (where.min() < 0 or where.max() >= len(connectivity)):
            raise ValueError("the cells do not fit their list of vertices")
        found.append(triangles(Cells(connectivity[where], np.concatenate([[0], np.cumsum(size)]), strips)))
    return np.concatenate(found)


def joined(
    pieces: list[tuple[Float[np.ndarray, "_ 3"], Int[np.ndarray, "_ 3"]]],
) -> tuple[Float[np.ndarray, "all_vertices 3"], Int[np.ndarray, "all_triangles 3"]]:
    """Several sets of triangles as one, their vertices renumbered.

    Raises:
        ValueError: when a triangle names a vertex that its own piece does not hold.
    """
    for vertices, faces in pieces:
        if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise ValueError("triangles refer to vertices that are not there")
    before = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
    all_vertices = np.concatenate([np.empty((0, 3)), *(vertices for vertices, _ in pieces)])
    faces = [faces + start for (_, faces), start in zip(pieces, before, strict=False)]
    return all_vertices, np.concatenate([np.empty((0, 3), np.int64), *faces])
