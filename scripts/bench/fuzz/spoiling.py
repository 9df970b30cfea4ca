"""Damaging a file's bytes as disks, networks and editors do."""

import numpy as np


def spoil(content: bytes, rng: np.random.Generator) -> bytes:
    """Cut, flip, repeat or replace bytes."""
    kind, where = int(rng.integers(6)), int(rng.integers(len(content) + 1))
    if kind == 0:
        return content[:where]
    if kind == 1:
        spoiled = bytearray(content)
        for at in rng.integers(len(content), size=int(rng.integers(1, 30))) if content else ():
            spoiled[at] = int(rng.integers(256))
        return bytes(spoiled)
    if kind == 2:
        return content[:where] + rng.bytes(int(rng.integers(1, 200))) + content[where:]
    if kind == 3:
        return content[where:] + content[:where]
    if kind == 4:
        return rng.bytes(int(rng.integers(0, 3000)))
    return content[:200] + content[where:]
