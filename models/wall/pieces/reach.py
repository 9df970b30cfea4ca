"""The part of a wall that a run can reach."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from haustra.models.devices.scope.outside import SLACK
from haustra.models.wall.pieces.wall import Wall


def within_reach(wall: Wall, entry: Float[np.ndarray, "3"], *, deepest: float) -> Wall:
    """The wall without pieces that are further from the entry than a scope of which `deepest` metres get in.

    That is exact: no point of a scope is further from the anus than the length that is inside. A piece's nearest point
    may lie inside a face, so a piece counts as far only when the sphere round its corners is.
    """
    kept = []
    for piece in wall.pieces:
        centre = piece.vertices.mean(axis=0)
        radius = np.linalg.norm(piece.vertices - centre, axis=1).max()
        if np.linalg.norm(centre - entry) - radius <= deepest + SLACK:
            kept.append(piece)
    return replace(wall, pieces=tuple(kept))
