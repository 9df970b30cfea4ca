"""Distance of points from a triangle surface."""

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from haustra.models.anatomy.colon import Surface

NEAREST_FACES = 24
"""Triangles tried per point for its distance to the surface, nearest centres first."""


def surface_distance(surface: Surface, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
    """Distance of points from a triangle surface [m], to the nearest among the faces whose centres are nearest."""
    return nearest_face(surface, points)[0]


def nearest_face(
    surface: Surface, points: Float[np.ndarray, "points 3"]
) -> tuple[Float[np.ndarray, " points"], Int[np.ndarray, " points"]]:
    """Distance of points from a triangle surface [m] and the face that is so near, as in `surface_distance`."""
    corners = surface.vertices[surface.faces]
    count = min(NEAREST_FACES, len(corners))
    nearest = np.asarray(KDTree(corners.mean(axis=1)).query(points, k=count)[1]).reshape(len(points), count)
    best, face = np.full(len(points), np.inf), np.zeros(len(points), np.int64)
    for tried in nearest.T:
        distance = _triangle_distance(points, corners[tried])
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
