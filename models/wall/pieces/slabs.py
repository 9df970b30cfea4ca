"""Pieces of a colon that moves, cut into slabs across its axis, so that no joint opens by more than a little."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Centreline
from haustra.models.wall.pieces.blocks import SLIVER
from haustra.models.wall.pieces.wall import Wall

SLAB = 0.007
"""Longest stretch of a colon that stays rigid [m], about two thirds of the distance between nodes of its axis: where a
bend of 30 mm tightens to half, joints of blocks of 20 mm open by 10 mm on its outside, and a tip gets out there;
engineering choice."""

THIN = 2e-4
"""Nothing thinner than this is cut off [m]: it would make a poor hull."""


@dataclass(frozen=True)
class Slab:
    """What moves as one."""

    arc: float
    """Arc length of its middle [m]."""
    place: Float[np.ndarray, "3"]
    """Point of the centreline there [m]."""
    pieces: tuple[Float[np.ndarray, "vertices 3"], ...]
    """Corners of convex solids [m]."""


def cut_into_slabs(wall: Wall, line: Centreline, *, longest: float = SLAB) -> Iterator[Slab]:
    """Cut each block of a wall across the centreline at equal distances, no more than `longest` [m]."""
    stretches: dict[tuple[float, float], list[np.ndarray]] = {}
    for piece in wall.pieces:
        stretches.setdefault((piece.start, piece.end), []).append(piece.vertices)
    for (start, end), pieces in stretches.items():
        bounds = np.linspace(start, end, max(1, int(np.ceil((end - start) / longest - 1e-9))) + 1)
        for number, (low, high) in enumerate(pairwise(bounds)):
            rest: list[np.ndarray] = pieces
            own = pieces
            if number + 2 < len(bounds):
                origin, normal = _at(line, high), _at(line, high + 1e-3) - _at(line, high - 1e-3)
                normal /= np.linalg.norm(normal)
                own, rest = (
                    [part for piece in pieces if len(part := _half(piece, origin, way * normal))] for way in (-1, 1)
                )
            middle = 0.5 * (low + high)
            yield Slab(middle, _at(line, middle), tuple(own))
            pieces = rest


def _half(piece: Float[np.ndarray, "vertices 3"], origin: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The part of a convex solid in front of a plane: its corners, none where it is a sliver."""
    from scipy.spatial import ConvexHull

    height = (piece - origin) @ normal
    if height.min() > -THIN:
        return piece
    if height.max() < THIN:
        return piece[:0]
    ahead, behind = piece[height > 0], piece[height <= 0]
    up, down = height[height > 0], height[height <= 0]
    share = up[:, None] / (up[:, None] - down)
    crossing = ahead[:, None] + share[..., None] * (behind - ahead[:, None])
    hull = ConvexHull(np.concatenate([ahead, crossing.reshape(-1, 3)]))
    return hull.points[hull.vertices] if hull.volume > SLIVER else piece[:0]


def _at(line: Centreline, arc: float) -> Float[np.ndarray, "3"]:
    return np.array([np.interp(arc, line.arc, line.points[:, axis]) for axis in range(3)])
