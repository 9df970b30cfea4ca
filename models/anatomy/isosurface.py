"""Closed surfaces of numbers on a grid, by marching tetrahedra.

Every cell is cut into six tetrahedra along its diagonal, so that there are no ambiguous cases: the surface is always
closed and a manifold, which marching cubes do not promise. Source: Doi, Koide, IEICE Trans. 1991;E74(1):214; the
cutting is Kuhn's.
"""

from itertools import permutations

import manifold3d
import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array

from haustra.models.anatomy.colon import Surface

NEAREST = 0.05
"""A vertex stays this share of a grid edge away from its ends: triangles without area would follow."""
SINGLES = ((0, 1, 2, 3), (1, 0, 3, 2), (2, 0, 1, 3), (3, 0, 2, 1))
"""Even orders of a tetrahedron's corners by the one that is apart."""
PAIRS = {(0, 1): (0, 1, 2, 3), (0, 2): (0, 2, 3, 1), (0, 3): (0, 3, 1, 2)}
PAIRS |= {(1, 2): (1, 2, 0, 3), (1, 3): (1, 3, 2, 0), (2, 3): (2, 3, 0, 1)}
SMOOTHING_ROUNDS = 10
"""Rounds of taking each vertex towards the mean of its neighbours and back, within its leash."""
SMOOTHING_STEPS = (0.5, -0.53)
"""Shares of the way: the second undoes the shrinking of the first (Taubin 1995, doi 10.1145/218380.218473)."""


def isosurface(values: Float[np.ndarray, "x y z"]) -> Surface:
    """The surface where `values` change sign, in grid coordinates, wound so that normals point to negative values.

    The outermost layer of the grid must be negative, or the surface is open there.
    """
    inside = values > 0
    mixed = _mixed_cells(inside)
    cell = np.argwhere(mixed)
    shape = np.array(values.shape)
    loops = []
    for order in permutations(range(3)):
        steps = np.concatenate([np.zeros((1, 3), int), np.cumsum(np.eye(3, dtype=int)[list(order)], axis=0)])
        corners = np.stack([np.ravel_multi_index(tuple((cell + step).T), values.shape) for step in steps], axis=1)
        even = bool(np.linalg.det(np.eye(3)[list(order)]) > 0)
        loops += _cut(corners, inside.ravel()[corners], even)
    ends = np.sort(np.concatenate(loops), axis=2)  # (triangles, 3, 2): the two grid points of each corner's edge
    key = ends[:, :, 0] * np.int64(np.prod(shape)) + ends[:, :, 1]
    edges, faces = np.unique(key, return_inverse=True)
    one, two = edges // int(np.prod(shape)), edges % int(np.prod(shape))
    a, b = values.ravel()[one], values.ravel()[two]
    share = np.clip(a / (a - b), NEAREST, 1 - NEAREST)[:, None]
    start, end = (np.stack(np.unravel_index(flat, values.shape), axis=1) for flat in (one, two))
    return Surface(vertices=start + share * (end - start), faces=faces.reshape(-1, 3).astype(np.int64))


def leashed_smoothing(surface: Surface, leash: float) -> Surface:
    """Take away the staircase of a label map: no vertex moves farther than `leash` along any axis.

    Source: constrained elastic surface nets, Gibson, MICCAI 1998, doi 10.1007/BFb0056277.
    """
    edges = surface.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    n = len(surface.vertices)
    links = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n)).tocsr()
    degree = np.asarray(links.sum(axis=1)).ravel()[:, None]
    vertices = surface.vertices
    for share in SMOOTHING_STEPS * SMOOTHING_ROUNDS:
        moved = vertices + share * (links @ vertices / degree - vertices)
        vertices = surface.vertices + np.clip(moved - surface.vertices, -leash, leash)
    return Surface(vertices=vertices, faces=surface.faces)


def simplified(surface: Surface, tolerance: float) -> Surface:
    """The surface with fewer triangles, none of which is farther than `tolerance` from where it was."""
    mesh = manifold3d.Mesh64(
        vert_properties=np.ascontiguousarray(surface.vertices), tri_verts=surface.faces.astype(np.uint64)
    )
    simple = manifold3d.Manifold(mesh).simplify(tolerance).to_mesh64()
    return Surface(np.asarray(simple.vert_properties)[:, :3].copy(), np.asarray(simple.tri_verts).astype(np.int64))


def _mixed_cells(inside: np.ndarray) -> np.ndarray:
    """Cells whose eight corners are not all alike."""
    corner = (slice(None, -1), slice(1, None))
    some = np.zeros(tuple(n - 1 for n in inside.shape), bool)
    every = np.ones_like(some)
    for x in corner:
        for y in corner:
            for z in corner:
                some |= inside[x, y, z]
                every &= inside[x, y, z]
    return some & ~every


def _cut(corners: Int[np.ndarray, "cells 4"], inside: np.ndarray, even: bool) -> list[np.ndarray]:
    """Triangles of one tetrahedron of each cell, every corner as the two grid points whose edge it lies on."""
    count, found = inside.sum(1), []

    def add(pick: np.ndarray, points: list[tuple[int, int]], turned: bool) -> None:
        triangle = np.stack([corners[pick][:, list(pair)] for pair in points], axis=1)
        found.append(triangle[:, ::-1] if turned else triangle)

    for a, b, c, d in SINGLES:
        add((count == 1) & inside[:, a], [(a, b), (a, c), (a, d)], not even)
        add((count == 3) & ~inside[:, a], [(a, b), (a, c), (a, d)], even)
    for (first, second), (a, b, c, d) in PAIRS.items():
        pick = (count == 2) & inside[:, first] & inside[:, second]
        add(pick, [(a, c), (a, d), (b, d)], not even)
        add(pick, [(a, c), (b, d), (b, c)], not even)
    return found
