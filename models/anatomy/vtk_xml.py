"""Surfaces from VTK's XML files (.vtp, .vtu, and .vtk that holds XML): ASCII, base64 and appended data, zlib and lzma.

Format: VTK file formats, https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html.
"""

import base64
import lzma
import re
import zlib
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from haustra.models.anatomy.vtk_cells import TYPES, Cells, joined, surface_cells, triangles

INFLATED_LIMIT = 2_000_000_000
"""Bytes that compressed blocks may claim to hold; more is a bomb."""
DECOMPRESS: dict[str, Callable[[bytes], bytes]] = {
    "vtkZLibDataCompressor": zlib.decompress,
    "vtkLZMADataCompressor": lzma.decompress,
}


class _Arrays:
    """Decodes the data arrays of one file."""

    def __init__(self, root: ElementTree.Element, appended: bytes, encoding: str):
        self._order = "<" if root.get("byte_order", "LittleEndian") == "LittleEndian" else ">"
        self._header = np.dtype(self._order + TYPES[root.get("header_type", "UInt32")])
        compressor = root.get("compressor")
        if compressor and compressor not in DECOMPRESS:
            raise ValueError(f"compression '{compressor[:30]}' is not known: save it with zlib or uncompressed")
        self._decompress = DECOMPRESS[compressor] if compressor else None
        self._appended, self._encoding = appended, encoding

    def __call__(self, element: ElementTree.Element | None) -> np.ndarray:
        """The numbers of a DataArray element."""
        if element is None:
            raise ValueError("a data array is missing")
        code = TYPES[element.get("type", "")]
        form = element.get("format", "ascii")
        if form == "ascii":
            return np.array((element.text or "").split(), dtype=code)
        if form == "appended":
            content = self._appended[int(element.get("offset", "0")) :]
            raw = self._raw(content) if self._encoding == "raw" else self._base64(content)
        else:
            raw = self._base64("".join((element.text or "").split()).encode())
        return np.frombuffer(raw, dtype=self._order + code).astype(code)

    def _base64(self, content: bytes) -> bytes:
        """Data after its header; with compression the header is encoded apart."""
        width = self._header.itemsize
        if self._decompress is None:
            size = int(np.frombuffer(base64.b64decode(content[: _encoded(width)])[:width], self._header)[0])
            return base64.b64decode(content[: _encoded(width + size)])[width : width + size]
        blocks = int(np.frombuffer(base64.b64decode(content[: _encoded(width)])[:width], self._header)[0])
        head = _encoded(width * (3 + blocks))
        return self._raw(base64.b64decode(content[:head]) + base64.b64decode(_whole(content[head:])))

    def _raw(self, content: bytes) -> bytes:
        width = self._header.itemsize
        first = int(np.frombuffer(content, self._header, count=1)[0])
        if self._decompress is None:
            return content[width : width + first]
        if first == 0:
            return b""
        head = np.frombuffer(content, self._header, count=3 + first).astype(np.int64)
        if first * int(head[1]) > INFLATED_LIMIT:
            raise ValueError("its compressed blocks claim to be too large")
        at, parts = width * (3 + first), []
        for size in head[3:]:
            parts.append(self._decompress(content[at : at + int(size)]))
            at += int(size)
        return b"".join(parts)


def read_vtk_xml(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of all pieces of an XML file, in its own units.

    Raises:
        ValueError: when it holds no surface, or is damaged.
    """
    content = file.read_bytes()
    appended, encoding = b"", "base64"
    if tag := re.search(rb"<AppendedData([^>]*)>\s*_", content):
        encoding = "raw" if b'"raw"' in tag.group(1) else "base64"
        end = content.rfind(b"</AppendedData>")
        appended = content[tag.end() : end if end > 0 else len(content)]
        content = content[: tag.start()] + b"</VTKFile>"  # raw bytes are no XML
    root = ElementTree.fromstring(content)
    kind = root.get("type", "")
    if root.tag != "VTKFile" or kind not in ("PolyData", "UnstructuredGrid"):
        raise ValueError(f"it holds {kind[:30] or root.tag[:30]}, not a surface")
    arrays = _Arrays(root, appended, encoding)
    return joined([_piece(piece, kind, arrays) for piece in root.iter("Piece")])


def _piece(piece: ElementTree.Element, kind: str, arrays: _Arrays) -> tuple[np.ndarray, np.ndarray]:
    points = arrays(piece.find("Points/DataArray")).reshape(-1, 3).astype(float)
    if kind == "UnstructuredGrid":
        connectivity, offsets = _lists(piece, "Cells", arrays)
        types = arrays(piece.find("Cells/DataArray[@Name='types']")).astype(np.int64)
        return points, surface_cells(connectivity, offsets, types)
    found = []
    for name, strips in (("Polys", False), ("Strips", True)):
        if piece.find(f"{name}/DataArray[@Name='offsets']") is not None:
            connectivity, offsets = _lists(piece, name, arrays)
            found.append(triangles(Cells(connectivity, offsets, strips)))
    return points, np.concatenate(found) if found else np.empty((0, 3), np.int64)


def _lists(piece: ElementTree.Element, name: str, arrays: _Arrays) -> tuple[np.ndarray, np.ndarray]:
    connectivity = arrays(piece.find(f"{name}/DataArray[@Name='connectivity']")).astype(np.int64)
    ends = arrays(piece.find(f"{name}/DataArray[@Name='offsets']")).astype(np.int64)
    return connectivity, np.concatenate([[0], ends])


def _encoded(size: int) -> int:
    """Characters of base64 for `size` bytes."""
    return 4 * ((size + 2) // 3)


def _whole(content: bytes) -> bytes:
    """Base64 up to where it ends: its padding, or the last group of four."""
    end = content.find(b"=")
    stop = len(content) if end < 0 else end + 2
    return content[: stop - stop % 4]
