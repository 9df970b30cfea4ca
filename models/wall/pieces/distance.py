"""Distance of points from a triangle surface."""

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from haustra.models.anatomy.colon import Surface

NEAREST_FACES = 24
"""Triangles tried per point for its distance to the surface, nearest centres first."""


class Faces:
    """The triangles of a surface, to be looked up by place."""

    def __init__(self, surface: Surface):
        self._corners = surface.vertices[surface.faces]
        self._tree = KDTree(self._corners.mean(axis=1))

    def nearest(
        self, points: Float[np.ndarray, "points 3"]
    ) -> tuple[Float[np.ndarray, " points"], Int[np.ndarray, " points"]]:
        """Distance of points from the surface [m] and the face that is so near, of those whose centres are nearest."""
        count = min(NEAREST_FACES, len(self._corners))
        nearest = np.asarray(self._tree.query(points, k=count, workers=-1)[1]).reshape(len(points), count)
        best, face = np.full(len(points), np.inf), np.zeros(len(points), np.int64)
        for tried in nearest.T:
            distance = _triangle_distance(points, self._corners[tried])
            face = np.where(distance < best, tried, face)
            best = np.minimum(best, distance)
        return best, face


def _triangle_distance(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Distance from each point to its own triangle (Ericson, Real-Time Collision Detection, 2005, section 5.1.5)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    inside = np.ones(len(points), bool)
    edges = np.full(len(points), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        side, offset = end - start, points - start
        inside &= np.einsum("ij,ij->i", np.cross(side, offset), normal) >= 0
        share = np.einsum("ij,ij->i", offset, side) / np.maximum(np.einsum("ij,ij->i", side, side), 1e-30)
        edges = np.minimum(edges, np.linalg.norm(offset - np.clip(share, 0, 1)[:, None] * side, axis=1))
    return np.where(inside, np.abs(np.einsum("ij,ij->i", points - a, normal)), edges)
