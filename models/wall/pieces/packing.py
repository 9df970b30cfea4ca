"""Blocks and hulls as bytes, for the pipe between a wall's builder and its workers, and for the cache."""

import io
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from manifold3d import Manifold, Mesh64

from haustra.models.wall.pieces.blocks import Block
from haustra.models.wall.pieces.cells import Site


def pack_block(block: Block) -> bytes:
    """A block as the bytes of an .npz; equal blocks give equal bytes."""
    mesh, site = block.solid.to_mesh64(), block.site
    return pack(
        vertices=np.asarray(mesh.vert_properties)[:, :3],
        faces=np.asarray(mesh.tri_verts).astype(np.int64),
        planes=np.array([(*normal, offset) for normal, offset in block.planes]),
        site=np.concatenate([site.frame.ravel(), site.point, [site.start, site.end, site.radius, site.reach]]),
    )


def unpack_block(data: bytes) -> Block:
    """The block that `pack_block` packed."""
    arrays = unpack(data)
    solid = Manifold(Mesh64(arrays["vertices"], arrays["faces"].astype(np.uint64)))
    planes = tuple((plane[:3], float(plane[3])) for plane in arrays["planes"])
    frame, point, numbers = np.split(arrays["site"], [9, 12])
    start, end, radius, reach = numbers.tolist()
    return Block(solid, planes, Site(start, end, point, frame.reshape(3, 3), radius, reach))


def pack_hulls(hulls: Sequence[Float[np.ndarray, "_ 3"]]) -> bytes:
    """Corners of convex hulls as the bytes of an .npz."""
    counts = np.array([len(hull) for hull in hulls], np.int64)
    return pack(vertices=np.concatenate([np.zeros((0, 3)), *hulls]), counts=counts)


def unpack_hulls(data: bytes) -> list[np.ndarray]:
    """The hulls that `pack_hulls` packed."""
    arrays = unpack(data)
    return np.split(arrays["vertices"], np.cumsum(arrays["counts"])[:-1]) if len(arrays["counts"]) else []


def pack(**arrays: np.ndarray) -> bytes:
    """Named arrays as the bytes of an .npz."""
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def unpack(data: bytes) -> dict[str, np.ndarray]:
    """The arrays that `pack` packed.

    Raises:
        ValueError, OSError, zipfile.BadZipFile: when the bytes are no such archive.
    """
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}
