"""The child process that decomposes blocks: `python -m haustra.models.wall.pieces.worker METHOD TOLERANCE`.

Reads blocks on stdin and writes hulls on stdout, each as its length in eight bytes and an .npz; ends with its parent.
"""

import os
import sys
from typing import BinaryIO

from haustra.models.wall.pieces.blocks import corners
from haustra.models.wall.pieces.packing import pack_hulls, unpack_block
from haustra.models.wall.pieces.split import convex_parts, is_convex

LENGTH = 8
"""Bytes of a length."""


def send(stream: BinaryIO, data: bytes) -> None:
    """Write one message."""
    stream.write(len(data).to_bytes(LENGTH, "little") + data)
    stream.flush()


def receive(stream: BinaryIO) -> bytes | None:
    """Read one message; None where the stream has ended."""
    head = stream.read(LENGTH)
    if len(head) < LENGTH:
        return None
    size = int.from_bytes(head, "little")
    data = stream.read(size)
    return data if len(data) == size else None


def decompose(data: bytes, method: str, tolerance: float) -> bytes:
    """Hulls of one packed block."""
    block = unpack_block(data)
    if method == "prism" or is_convex(block, tolerance=tolerance):
        hulls = convex_parts(block, tolerance=tolerance)
    else:
        from haustra.models.wall.pieces.coacd_block import coacd_parts

        hulls = coacd_parts(block, tolerance=tolerance)
    return pack_hulls([corners(hull) for hull in hulls])


def main(method: str, tolerance: float) -> None:
    """Serve until the parent closes the pipe."""
    # Native code prints on stdout; the answers keep the pipe to themselves.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    while (data := receive(sys.stdin.buffer)) is not None:
        send(answers, decompose(data, method, tolerance))


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
