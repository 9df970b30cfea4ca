"""Whether points are within a closed surface: how often it winds around them."""

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Surface

_AT_ONCE = 2_000_000
"""Pairs of points and triangles that are looked at together: 200 MB."""


def winding_numbers(surface: Surface, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
    """Solid angle under which points see a surface, over 4 pi: 1 within, 0 without, whatever else the surface does.

    Each triangle's by van Oosterom & Strackee (1983), eq. 8.

    Args:
        surface: closed, wound so that normals point outwards.
        points: [m].
    """
    corners = surface.vertices[surface.faces]
    some = max(1, _AT_ONCE // len(corners))
    parts = [_solid_angles(corners, points[row : row + some]) for row in range(0, len(points), some)]
    return np.concatenate(parts) / (4 * np.pi) if parts else np.zeros(0)


def _solid_angles(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    a, b, c = (corners[None, :, corner] - points[:, None] for corner in range(3))
    x, y, z = (np.linalg.norm(side, axis=-1) for side in (a, b, c))
    volume = np.einsum("pti,pti->pt", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("pti,pti->pt", *pair) for pair in ((a, b), (b, c), (c, a)))
    return 2 * np.arctan2(volume, x * y * z + ab * z + bc * x + ca * y).sum(axis=1)
