"""The wall without thickness: where the lumen surface is nearest, looked for in a point's own stretch of the colon.

Convex pieces end: pressed deep enough, a device is pushed out sideways or passes through. The distance from the lumen
surface has no such end, no joints, and one depth at a point, so that one contact carries one stiffness.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from manifold3d import Manifold, Mesh64
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from haustra.models.anatomy.colon import Colon
from haustra.models.wall.blocks import ENTRY_RADIUS, vertex_normals

LONGEST_EDGE = 0.006
"""Triangles are divided until no edge is longer [m], so that the nearest is among the few with the nearest centres."""
CANDIDATES = 12
"""Triangles tried for each point, nearest centres first."""
ARC_WEIGHT = 0.4
"""How much a difference of arc length counts against distance when candidates are sought: 0.1 m along the colon, the
least between two loops, is then as far as 0.04 m across, more than any press is deep."""
ANUS = 0.004
"""Triangles within this of the anal end's plane [m] and inside the entry are the lid of the surface, not wall."""
ON_SURFACE = 2e-4
"""Nearer to the surface than this [m], the direction is the surface's own normal."""


@dataclass(frozen=True)
class Feet:
    """The nearest place of the lumen surface to each of some points."""

    points: Float[np.ndarray, "points 3"]
    """Where it is [m]."""
    inwards: Float[np.ndarray, "points 3"]
    """Unit vectors from there into the lumen, along the line to the point."""
    outside: Float[np.ndarray, " points"]
    """Distance from the surface [m], positive outside the lumen."""
    arcs: Float[np.ndarray, " points"]
    """Arc length of that place along the centreline [m]."""


class WallField:
    """Signed distance from a colon's lumen surface, with loops kept apart by arc length."""

    def __init__(self, colon: Colon) -> None:
        """Divide the surface and give every triangle its arc length."""
        self.anus, self.inwards = colon.centreline.points[0], colon.centreline.frames[0][:, 2]
        solid = Manifold(Mesh64(colon.lumen.vertices, colon.lumen.faces.astype(np.uint64)))
        mesh = solid.refine_to_length(LONGEST_EDGE).to_mesh64()
        vertices = np.asarray(mesh.vert_properties)[:, :3]
        faces = np.asarray(mesh.tri_verts).astype(np.int64)
        arcs = _vertex_arcs(colon, vertices, faces)[faces].mean(axis=1)
        kept = ~_lid(colon, vertices[faces].mean(axis=1))
        faces, self._arcs = faces[kept], arcs[kept]
        self._corners = vertices[faces]
        self._normals = vertex_normals(vertices, np.asarray(mesh.tri_verts).astype(np.int64))[faces]
        self._tree = KDTree(np.column_stack([self._corners.mean(axis=1), ARC_WEIGHT * self._arcs]))

    def nearest(self, points: Float[np.ndarray, "points 3"], arcs: Float[np.ndarray, " points"]) -> Feet:
        """The nearest place of the wall to points [m] that are near those arc lengths [m]."""
        places = np.column_stack([points, ARC_WEIGHT * arcs])
        found = np.asarray(self._tree.query(places, k=CANDIDATES)[1])
        feet, weights = _closest(points[:, None], self._corners[found])
        apart = points[:, None] - feet
        squared = np.einsum("pci,pci->pc", apart, apart)
        best = squared.argmin(axis=1)
        rows = np.arange(len(points))
        triangle = found[rows, best]
        apart = apart[rows, best]
        distance = np.sqrt(squared[rows, best])
        outwards = np.einsum("pk,pki->pi", weights[rows, best], self._normals[triangle])
        outwards /= np.maximum(np.linalg.norm(outwards, axis=1), 1e-12)[:, None]
        sign = np.where(np.einsum("pi,pi->p", apart, outwards) > 0, 1.0, -1.0)
        away = -sign[:, None] * apart / np.maximum(distance, 1e-12)[:, None]
        inwards = np.where((distance < ON_SURFACE)[:, None], -outwards, away)
        return Feet(feet[rows, best], inwards, sign * distance, self._arcs[triangle])


def _vertex_arcs(colon: Colon, vertices: np.ndarray, faces: np.ndarray) -> Float[np.ndarray, " vertices"]:
    """Arc length of each vertex: that of the place the centreline sees which is nearest along the surface."""
    line = colon.centreline
    angles = 2 * np.pi * np.arange(colon.radius.shape[1]) / colon.radius.shape[1]
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    across = np.einsum("sij,aj->sai", line.frames[:, :, :2], around)
    seen = line.points[:, None] + colon.radius[:, :, None] * across
    arcs = np.repeat(line.arc, len(angles))
    distance, vertex = (np.asarray(found) for found in KDTree(vertices).query(seen.reshape(-1, 3)))
    # Of the places seen next to one vertex, the one nearest to it counts.
    order = np.argsort(-distance)
    arc_of = np.full(len(vertices), np.nan)
    arc_of[vertex[order]] = arcs[order]
    sources = np.flatnonzero(np.isfinite(arc_of))
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    graph = coo_array((np.maximum(length, 1e-9), edges.T), shape=(len(vertices), len(vertices))).tocsr()
    _, _, source = dijkstra(graph, directed=False, indices=sources, min_only=True, return_predecessors=True)
    return arc_of[np.asarray(source)]


def _lid(colon: Colon, centres: Float[np.ndarray, "triangles 3"]) -> np.ndarray:
    """Which triangles close the surface at the anus, where the scope comes in."""
    offset = centres - colon.centreline.points[0]
    axis = colon.centreline.frames[0][:, 2]
    along = offset @ axis
    aside = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    return (along < ANUS) & (aside < ENTRY_RADIUS)


def _closest(
    points: Float[np.ndarray, "points 1 3"], corners: Float[np.ndarray, "points candidates 3 3"]
) -> tuple[np.ndarray, np.ndarray]:
    """Closest place of each triangle, and its barycentric weights (Ericson 2005, section 5.1.5)."""
    a, b, c = corners[:, :, 0], corners[:, :, 1], corners[:, :, 2]
    ab, ac = b - a, c - a
    offset = points - a

    def dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return np.einsum("pci,pci->pc", first, second)

    bb, cc, bc = dot(ab, ab), dot(ac, ac), dot(ab, ac)
    pb, pc = dot(offset, ab), dot(offset, ac)
    det = np.maximum(bb * cc - bc * bc, 1e-30)
    v, w = (cc * pb - bc * pc) / det, (bb * pc - bc * pb) / det
    inside = (v >= 0) & (w >= 0) & (v + w <= 1)
    # Otherwise the closest place lies on an edge: of the three, the nearest.
    on_ab = np.clip(pb / np.maximum(bb, 1e-30), 0, 1)
    on_ac = np.clip(pc / np.maximum(cc, 1e-30), 0, 1)
    along = bb - 2 * bc + cc
    on_bc = np.clip((pc - pb - bc + bb) / np.maximum(along, 1e-30), 0, 1)
    zero = np.zeros_like(v)
    choices = np.stack(
        [np.stack([v, w]), np.stack([on_ab, zero]), np.stack([zero, on_ac]), np.stack([1 - on_bc, on_bc])]
    )
    # |a + v ab + w ac - p|^2 up to a constant
    cost = (
        choices[:, 0] ** 2 * bb
        + choices[:, 1] ** 2 * cc
        + 2 * choices[:, 0] * choices[:, 1] * bc
        - 2 * (choices[:, 0] * pb + choices[:, 1] * pc)
    )
    cost[0] = np.where(inside, -np.inf, np.inf)
    pick = cost.argmin(axis=0)
    v, w = np.take_along_axis(choices, pick[None, None], axis=0)[0]
    return a + v[..., None] * ab + w[..., None] * ac, np.stack([1 - v - w, v, w], axis=-1)
