"""Pieces cut back where they stand in the lumen of another loop than their own.

A piece keeps to one tolerance all round, but only its inner side is wall of its own loop: its outer side is thickness,
and where that stands in a neighbour's lumen it narrows it for nothing. What bulges into the piece is cut off by a plane
that touches the bulge, so that what is left is convex and outside; wall that lies beyond that plane, beside the bulge,
is kept as pieces of its own, cut likewise.
"""

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np
from manifold3d import Manifold

from haustra.models.wall.pieces.blocks import SLIVER, corners
from haustra.models.wall.pieces.neighbours import Neighbours, Standing, another_loop
from haustra.models.wall.pieces.split import face_normals
from haustra.models.wall.pieces.wall import WallPiece

NOTHING = 1e-13
"""Volume [m^3] of lumen in a piece that is rounding: 0.05 mm deep it would be 2 mm^2 wide."""
LEFT_OUT = 0.0005
"""How far [m] wall must reach beyond a cut to be kept: to stand back by less is within any tolerance."""
DIRECTIONS = 8
"""Faces of a bulge whose planes are tried, the largest first."""
MOST_CUTS = 12
"""Cuts one after the other before the rest of a piece is left out; there to end degenerate cases."""
SHARE = 0.02
"""Share of a bulge's surface from which on it is another loop's. Where loops have grown together it is both's, and to
cut off more opens a way through (EdinGCA_3D_00020: at 0.002, 4 of 99,854 rays leak)."""
MARGIN = 0.002
"""How much more of the lumen [m] than the pieces' box is taken."""


class Cleared(NamedTuple):
    """Pieces that keep out of their neighbours' lumens."""

    pieces: tuple[WallPiece, ...]
    """All pieces, in the order of those that they were cut from."""
    cut: int
    """How many of those stood there, or seemed to, and were cut."""
    left: Standing
    """Where what was cut from these still does."""


def clear_neighbours(neighbours: Neighbours, pieces: Sequence[WallPiece]) -> Cleared:
    """The pieces without what stands in another loop's lumen."""
    found = np.unique(neighbours.standing(pieces).pieces)
    cleared: dict[int, list[WallPiece]] = {}
    for _, group in groupby(found, key=lambda number: pieces[number].start):
        numbers = list(group)
        near = _crop(neighbours.solid, np.concatenate([pieces[number].vertices for number in numbers]))
        for number in numbers:
            piece = pieces[number]
            whose = _Stretch(neighbours.solid.original_id(), piece.start, piece.end)
            parts = _cleared(Manifold.hull_points(piece.vertices), _crop(near, piece.vertices), whose)
            cleared[number] = [WallPiece(np.ascontiguousarray(corners(part)), piece.start, piece.end) for part in parts]
    return Cleared(
        tuple(part for number, piece in enumerate(pieces) for part in cleared.get(number, [piece])),
        len(cleared),
        neighbours.standing([part for number in sorted(cleared) for part in cleared[number]]),
    )


class _Stretch(NamedTuple):
    """Whose wall a piece is."""

    lumen: int
    """What manifold3d knows the lumen's surface by."""
    start: float
    """Arc length where the piece's stretch begins [m]."""
    end: float
    """Arc length where it ends [m]."""


def _crop(lumen: Manifold, points: np.ndarray) -> Manifold:
    low, high = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
    return lumen ^ Manifold.cube(tuple(high - low)).translate(tuple(low))


def _cleared(hull: Manifold, lumen: Manifold, whose: _Stretch, cuts: int = 0) -> Iterator[Manifold]:
    """Convex parts of a hull outside the lumen of other loops."""
    bulges = _bulges(hull, lumen, whose)
    if not bulges:
        yield hull
        return
    if cuts >= MOST_CUTS:
        return
    normal, offset = _touching(hull, *max(bulges, key=lambda bulge: bulge[0].volume()))
    rest = hull.trim_by_plane(tuple(-normal), -offset)
    for bulge, _ in bulges:
        rest = rest - bulge
    parts = [part for part in rest.decompose() if (offset - corners(part) @ normal).max() >= LEFT_OUT]
    for part in (hull.trim_by_plane(tuple(normal), offset), *parts):
        if part.volume() > SLIVER:
            yield from _cleared(part.hull(), lumen, whose, cuts + 1)


def _bulges(hull: Manifold, lumen: Manifold, whose: _Stretch) -> list[tuple[Manifold, np.ndarray]]:
    """What of other loops' lumens is in a hull, and the corners of that surface's faces, the largest first."""
    found = []
    inside = hull ^ lumen
    for bulge in inside.decompose() if inside.volume() > NOTHING else ():
        if bulge.volume() <= NOTHING:
            continue
        mesh = bulge.to_mesh64()
        runs = np.repeat(mesh.run_original_id, np.diff(np.asarray(mesh.run_index).astype(int) // 3))
        faces = np.asarray(mesh.vert_properties)[np.asarray(mesh.tri_verts).astype(int)[runs == whose.lumen]]
        _, twice = face_normals(faces[..., :3])
        strange = another_loop(faces[..., 3].mean(axis=1), whose.start, whose.end)
        if len(faces) and twice[strange].sum() > SHARE * twice.sum():
            found.append((bulge, faces[np.argsort(-twice)][..., :3]))
    return found


def _touching(hull: Manifold, bulge: Manifold, faces: np.ndarray) -> tuple[np.ndarray, float]:
    """The plane that touches a bulge and leaves most of the hull beyond it: n.x >= d is outside the bulge."""
    normals, twice = face_normals(faces)
    mean = (normals * twice[:, None]).sum(axis=0)
    tried = np.concatenate([mean[None] / max(float(np.linalg.norm(mean)), 1e-30), normals[:DIRECTIONS]])
    offsets = (corners(bulge) @ tried.T).max(axis=0)
    left = [hull.trim_by_plane(tuple(normal), offset).volume() for normal, offset in zip(tried, offsets, strict=True)]
    best = int(np.argmax(left))
    return tried[best], float(offsets[best])
