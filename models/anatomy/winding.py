"""Whether points are within a closed surface: how often it winds around them."""

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Surface


def winding_numbers(surface: Surface, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
    """Solid angle under which points see a surface, over 4 pi: 1 within, 0 without, whatever else the surface does.

    Each triangle's by van Oosterom & Strackee (1983), eq. 8.

    Args:
        surface: closed, wound so that normals point outwards.
        points: [m].
    """
    corners = surface.vertices[surface.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    heights = np.einsum("ti,ti->t", normals, corners[:, 0])
    squares = ((corners - np.roll(corners, -1, axis=1)) ** 2).sum(axis=2)
    found = []
    for point in points:
        away = np.sqrt(((surface.vertices - point) ** 2).sum(axis=1))
        x, y, z = away[surface.faces].T
        # Products of the corners' places come from the triangle's sides, their determinant from its normal.
        xy, yz, zx = ((i * i + j * j - side) / 2 for i, j, side in zip((x, y, z), (y, z, x), squares.T, strict=True))
        found.append(np.arctan2(heights - normals @ point, x * y * z + xy * z + yz * x + zx * y).sum())
    return np.array(found) / (2 * np.pi)
