"""Surfaces from VTK's legacy files (.vtk): polygons, strips and unstructured grids, ASCII and binary.

Format: VTK file formats, https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html; versions 1.0 to 5.1.
VTK itself would be an install of 140 MB for this page of code.
"""

from pathlib import Path

import numpy as np

from haustra.models.anatomy.vtk_cells import TYPES, Cells, surface_cells, triangles

FACES = {"POLYGONS": False, "TRIANGLE_STRIPS": True}
"""Sections of a polygonal data set that hold surface, and whether they are strips."""
SKIPPED_CELLS = ("VERTICES", "LINES")
"""Sections of a polygonal data set that hold none."""
ENDS = ("POINT_DATA", "CELL_DATA")
"""What comes after the geometry."""


class _Reader:
    """A cursor over the bytes of a legacy file."""

    def __init__(self, content: bytes):
        lines = content.split(b"\n", 3)
        if len(lines) < 4 or not lines[0].startswith(b"# vtk DataFile Version"):
            raise ValueError("it does not begin with '# vtk DataFile Version'")
        kind = lines[2].strip().upper()
        if kind not in (b"ASCII", b"BINARY"):
            raise ValueError("it is neither ASCII nor BINARY")
        self._binary = kind == b"BINARY"
        self._modern = int(lines[0].split()[-1].split(b".")[0]) >= 5
        self._rest = lines[3]

    def words(self) -> list[str]:
        """The words of the next line that has any; none at the end."""
        while self._rest:
            line, _, self._rest = self._rest.partition(b"\n")
            if line.strip():
                return line.decode("utf-8", "replace").split()
        return []

    def numbers(self, count: int, kind: str) -> np.ndarray:
        """The next `count` numbers of a type."""
        code = TYPES.get(kind) or TYPES.get(kind.lower())
        if code is None:
            raise ValueError(f"numbers of type '{kind[:20]}' are not known")
        if count < 0 or count > len(self._rest):
            raise ValueError("it is truncated")
        if self._binary:
            size = count * np.dtype(code).itemsize
            if len(self._rest) < size:
                raise ValueError("it is truncated")
            found = np.frombuffer(self._rest, dtype=f">{code}", count=count)
            self._rest = self._rest[size:]
            return found.astype(code)
        parts = self._rest.split(None, count)
        if len(parts) < count:
            raise ValueError("it is truncated")
        self._rest = parts[count] if len(parts) > count else b""
        return np.array(parts[:count], dtype=float if code.startswith("f") else np.int64)

    def cells(self, head: list[str]) -> Cells:
        """The cells of a section whose first line is given."""
        count, size = int(head[1]), int(head[2])
        if self._modern:
            offsets = self.numbers(count, self.words()[1]).astype(np.int64)
            return Cells(self.numbers(size, self.words()[1]).astype(np.int64), offsets)
        listed = self.numbers(size, "int").astype(np.int64)
        return _listed_cells(listed, count)

    def skip_metadata(self) -> None:
        """Pass over what stands up to the next empty line."""
        _, _, self._rest = self._rest.partition(b"\n\n")

    def skip_fields(self, count: int) -> None:
        """Pass over arrays that belong to the data set as a whole."""
        for _ in range(count):
            head = self.words()
            if head[0] == "METADATA":
                self.skip_metadata()
                head = self.words()
            self.numbers(int(head[1]) * int(head[2]), head[3])


def read_vtk_legacy(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of a legacy file, in its own units.

    Raises:
        ValueError: when it is truncated or holds no geometry of a known kind.
    """
    reader = _Reader(file.read_bytes())
    points = np.empty((0, 3))
    found: list[np.ndarray] = []
    grid: Cells | None = None
    while (head := reader.words()) and head[0].upper() not in ENDS:
        name = head[0].upper()
        if name == "DATASET":
            if head[1].upper() not in ("POLYDATA", "UNSTRUCTURED_GRID"):
                raise ValueError(f"it holds a {head[1][:20]}, not a surface")
        elif name == "POINTS":
            points = reader.numbers(3 * int(head[1]), head[2]).reshape(-1, 3).astype(float)
        elif name in FACES:
            cells = reader.cells(head)
            found.append(triangles(Cells(cells.connectivity, cells.offsets, strips=FACES[name])))
        elif name in SKIPPED_CELLS:
            reader.cells(head)
        elif name == "CELLS":
            grid = reader.cells(head)
        elif name == "CELL_TYPES":
            types = reader.numbers(int(head[1]), "int")
            if grid is None:
                raise ValueError("types of cells come before the cells")
            found.append(surface_cells(grid.connectivity, grid.offsets, types.astype(np.int64)))
        elif name == "METADATA":
            reader.skip_metadata()
        elif name == "FIELD":
            reader.skip_fields(int(head[2]))
        else:
            raise ValueError(f"section '{name[:20]}' is not known")
    return points, np.concatenate(found) if found else np.empty((0, 3), np.int64)


def _listed_cells(listed: np.ndarray, count: int) -> Cells:
    """Cells from a list of 'how many, which, how many, which, ...'."""
    if count and len(listed) % count == 0 and (listed[:: len(listed) // count] == len(listed) // count - 1).all():
        each = len(listed) // count - 1  # all alike, as in a file of triangles
        return Cells(listed.reshape(count, -1)[:, 1:].ravel(), np.arange(count + 1) * each)
    sizes, at = [], 0
    for _ in range(count):
        if at >= len(listed) or listed[at] < 0:
            raise ValueError("the list of cells is damaged")
        sizes.append(int(listed[at]))
        at += sizes[-1] + 1
    if at != len(listed):
        raise ValueError("the list of cells is damaged")
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    keep = np.ones(len(listed), bool)
    keep[offsets[:-1] + np.arange(count)] = False
    return Cells(listed[keep], offsets)
