"""Whether points are within a closed surface: how often it winds around them."""

from collections.abc import Callable
from functools import cache
from inspect import unwrap
from typing import Any

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
    halves = _compiled()(surface.vertices, surface.faces, normals, heights, squares, np.ascontiguousarray(points))
    return halves / (2 * np.pi)


def _half_angles(vertices: Any, faces: Any, normals: Any, heights: Any, squares: Any, points: Any) -> np.ndarray:
    """Half of the solid angle of all triangles, from each point [rad]."""
    found, away = np.zeros(len(points)), np.empty(len(vertices))
    for row in range(len(points)):
        px, py, pz = points[row]
        for i in range(len(vertices)):
            away[i] = np.sqrt((vertices[i, 0] - px) ** 2 + (vertices[i, 1] - py) ** 2 + (vertices[i, 2] - pz) ** 2)
        total = 0.0
        for t in range(len(faces)):
            x, y, z = away[faces[t, 0]], away[faces[t, 1]], away[faces[t, 2]]
            # Products of the corners' places come from the triangle's sides, their determinant from its normal.
            xy, yz = (x * x + y * y - squares[t, 0]) / 2, (y * y + z * z - squares[t, 1]) / 2
            zx = (z * z + x * x - squares[t, 2]) / 2
            apart = heights[t] - normals[t, 0] * px - normals[t, 1] * py - normals[t, 2] * pz
            total += np.arctan2(apart, x * y * z + xy * z + yz * x + zx * y)
        found[row] = total
    return found


@cache
def _compiled() -> Callable[..., np.ndarray]:
    from numba import njit

    compiled: Any = njit(unwrap(_half_angles), nogil=True, cache=True)
    return compiled
