"""Where a surface crosses itself."""

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from haustra.models.anatomy.colon import Surface

PARALLEL = 1e-12
"""Volume over the cube of the edge [1] below which a line and a triangle are parallel: they do not cross, they lie."""
_EDGES = ((0, 1), (1, 2), (2, 0))


def crossing_triangles(surface: Surface) -> Int[np.ndarray, "pairs 2"]:
    """Pairs of triangles that cross: an edge of one passes through the other.

    Neighbours along an edge are not looked at; neighbours at a vertex cross when the edge opposite to it does.
    """
    corners = surface.vertices[surface.faces]
    centre = corners.mean(axis=1)
    reach = np.sqrt(((corners - centre[:, None]) ** 2).sum(2).max())
    pairs = KDTree(centre).query_pairs(2 * reach, output_type="ndarray")
    low, high = corners.min(axis=1), corners.max(axis=1)
    one, two = pairs.T
    pairs = pairs[((low[one] <= high[two]) & (low[two] <= high[one])).all(axis=1)]
    one, two = pairs.T
    same = surface.faces[one][:, :, None] == surface.faces[two][:, None, :]
    shared = same.sum((1, 2))
    crosses = np.zeros(len(pairs), bool)
    for first, second, meeting in ((one, two, same.any(2)), (two, one, same.any(1))):
        for start, end in _EDGES:
            touching = meeting[:, start] | meeting[:, end]
            asked = np.flatnonzero((shared < 2) & ~touching)
            edge = corners[first[asked]][:, [start, end]]
            crosses[asked] |= _passes(edge[:, 0], edge[:, 1], corners[second[asked]])
    return pairs[crosses]


def _passes(
    start: Float[np.ndarray, "edges 3"], end: Float[np.ndarray, "edges 3"], triangle: Float[np.ndarray, "edges 3 3"]
) -> np.ndarray:
    """Whether each edge passes through its triangle; Moeller and Trumbore, J. Graphics Tools 1997;2(1):21."""
    along, side, other = end - start, triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0]
    normal = np.cross(along, other)
    volume = (side * normal).sum(1)
    size = np.abs(np.concatenate([along, side, other], axis=1)).max(1, initial=0.0)
    flat = np.abs(volume) <= PARALLEL * size**3
    inverse = 1 / np.where(flat, 1.0, volume)
    offset = start - triangle[:, 0]
    u = (offset * normal).sum(1) * inverse
    turned = np.cross(offset, side)
    v = (along * turned).sum(1) * inverse
    t = (other * turned).sum(1) * inverse
    return ~flat & (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)
