"""How the console's page is told things: a JSON header, then arrays as they lie in memory.

Four bytes say how long the header is, little-endian; spaces fill the header up, so that arrays begin at a multiple
of four. Its entry `arrays` lists name, type, shape and offset behind the header of each array.
"""

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

_TYPES = {"float32": "<f4", "int32": "<i4", "uint8": "|u1"}


def pack(header: Mapping[str, Any], arrays: Mapping[str, np.ndarray] | None = None) -> bytes:
    """One message."""
    listed, parts, offset = [], [], 0
    for name, values in (arrays or {}).items():
        kind = {"f": "float32", "i": "int32", "u": "uint8"}[values.dtype.kind]
        content = np.ascontiguousarray(values, _TYPES[kind]).tobytes()
        listed.append([name, kind, list(values.shape), offset])
        content += bytes(-len(content) % 4)
        parts.append(content)
        offset += len(content)
    text = json.dumps({**header, "arrays": listed}, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<I", len(text)) + text + b"".join(parts)


def unpack(message: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Header and arrays of a message of `pack`."""
    (length,) = struct.unpack_from("<I", message)
    header = json.loads(message[4 : 4 + length])
    arrays = {}
    for name, kind, shape, offset in header.pop("arrays"):
        begin = 4 + length + offset
        values = np.frombuffer(message, _TYPES[kind], count=int(np.prod(shape)), offset=begin)
        arrays[name] = values.reshape(shape)
    return header, arrays


def plain(row: Mapping[str, Any]) -> dict[str, float]:
    """Single numbers of a row, rounded to what is shown; numbers that are none are left out."""
    found = {}
    for name, value in row.items():
        if name != "digest" and np.ndim(value) == 0 and np.isfinite(value):
            found[name] = round(float(value), 6)
    return found
