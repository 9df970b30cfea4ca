"""The wall without thickness: where the lumen surface is nearest, looked for in a point's own stretch of the colon.

Convex pieces end: pressed deep enough, a device is pushed out sideways or passes through. The distance from the lumen
surface has no such end, no joints, and one depth at a point, so that one contact carries one stiffness.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from manifold3d import Manifold, Mesh64
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.rays import LumenRays
from haustra.models.wall.mesentery import axis_nodes
from haustra.models.wall.pieces.blocks import ENTRY_RADIUS, vertex_normals

LONGEST_EDGE = 0.006
"""Triangles are divided until no edge is longer [m], so that the nearest is among the few with the nearest centres."""
CANDIDATES = 12
"""Triangles tried for each point, nearest centres first."""
ARC_WEIGHT = 0.4
"""How much a difference of arc length counts against distance when candidates are sought: 0.1 m along the colon, the
least between two loops, is then as far as 0.04 m across, more than any press is deep."""
ANUS = 0.004
"""Triangles within this of the anal end's plane [m] and inside the entry are the lid of the surface, not wall."""
_SMOOTHINGS = 30
"""Rounds in which a vertex's arc length is averaged with its neighbours': where folds hide the surface it jumps."""
_FROM_SEEN = 0.06
"""A vertex stands in a section at most so far from where the centreline sees it [m]; engineering choice."""
_SECTION_ROUNDS, _SECTION_SHARE, _LONGEST_STEP, _LEAST_ROOM = 60, 0.7, 0.003, 0.2
"""Rounds in which a vertex's section is sought, by a share of how far it is ahead, by at most so much [m]; and the
least of the way along its inside that a bend is taken to leave [1]. Where sections cross, it goes to and fro. All are
an engineering choice."""
HIGHEST_FOLD = 0.05
"""No fold stands further into the lumen than this [m]."""
ON_SURFACE = 2e-4
"""Nearer to the surface than this [m], the direction is the surface's own normal."""


@dataclass(frozen=True)
class ClosestPoints:
    """The nearest place of the lumen surface to each of some points."""

    points: Float[np.ndarray, "points 3"]
    """Where it is [m]."""
    inwards: Float[np.ndarray, "points 3"]
    """Unit vectors from there into the lumen, along the line to the point."""
    normals: Float[np.ndarray, "points 3"]
    """Normals of the surface there, into the lumen: not of unit length."""
    outside: Float[np.ndarray, " points"]
    """Distance from the surface [m], positive outside the lumen."""
    arcs: Float[np.ndarray, " points"]
    """Arc length of that place along the centreline [m]."""

    def __getitem__(self, which: Any) -> "ClosestPoints":
        """Some of them."""
        return ClosestPoints(
            self.points[which], self.inwards[which], self.normals[which], self.outside[which], self.arcs[which]
        )


class LumenDistance:
    """Signed distance from a colon's lumen surface, with loops kept apart by arc length."""

    def __init__(self, colon: Colon, *, by_sections: bool = False) -> None:
        """Divide the surface and give every triangle its arc length.

        Args:
            colon: whose lumen surface.
            by_sections: let arc lengths be those of the cross-sections that places stand in, smooth along the surface
                as a colon that moves needs them; those of the places that the centreline sees are found sooner.
        """
        self.anus, self.inwards = colon.centreline.points[0], colon.centreline.frames[0][:, 2]
        solid = Manifold(Mesh64(colon.lumen.vertices, colon.lumen.faces.astype(np.uint64)))
        mesh = solid.refine_to_length(LONGEST_EDGE).to_mesh64()
        vertices = np.asarray(mesh.vert_properties)[:, :3]
        faces = np.asarray(mesh.tri_verts).astype(np.int64)
        self._by_sections, arcs_of = by_sections, section_arcs if by_sections else _vertex_arcs
        arcs = arcs_of(colon, vertices, faces)[faces]
        kept = ~_lid(colon, vertices[faces].mean(axis=1))
        faces, self._corner_arcs = faces[kept], arcs[kept]
        self._arcs = self._corner_arcs.mean(axis=1)
        self._triangles = _packed(vertices[faces])
        self._normals = vertex_normals(vertices, np.asarray(mesh.tri_verts).astype(np.int64))[faces]
        self._line, self._lumen = colon.centreline, colon.lumen
        self._tree = KDTree(np.column_stack([vertices[faces].mean(axis=1), ARC_WEIGHT * self._arcs]))

    @property
    def triangle_arcs(self) -> Float[np.ndarray, " triangles"]:
        """Arc length of each triangle [m]."""
        return self._arcs

    @cached_property
    def _rays(self) -> LumenRays:
        """Built when it is first asked for: tables never are."""
        return LumenRays(self._lumen)

    def nearest(self, points: Float[np.ndarray, "points 3"], arcs: Float[np.ndarray, " points"]) -> ClosestPoints:
        """The nearest place of the wall to points [m] that are near those arc lengths [m]."""
        return self.nearest_of(points, self.candidates(points, arcs))

    def candidates(
        self, points: Float[np.ndarray, "points 3"], arcs: Float[np.ndarray, " points"], *, count: int = CANDIDATES
    ) -> Int[np.ndarray, "points candidates"]:
        """Triangles that may be nearest to points [m] near those arc lengths [m]."""
        places = np.column_stack([points, ARC_WEIGHT * arcs])
        return np.asarray(self._tree.query(places, k=count)[1])

    def nearest_of(
        self, points: Float[np.ndarray, "points 3"], candidates: Int[np.ndarray, "points candidates"]
    ) -> ClosestPoints:
        """The nearest place of some triangles to each point [m]."""
        best, v, w = _closest(points, self._triangles[candidates])
        triangle = candidates[np.arange(len(points)), best]
        chosen, normals = self._triangles[triangle], self._normals[triangle]
        feet = chosen[:, 0:3] + v[:, None] * chosen[:, 3:6] + w[:, None] * chosen[:, 6:9]
        apart = points - feet
        distance = np.sqrt(np.einsum("pi,pi->p", apart, apart))
        outwards = (
            normals[:, 0] + v[:, None] * (normals[:, 1] - normals[:, 0]) + w[:, None] * (normals[:, 2] - normals[:, 0])
        )
        sign = np.where(np.einsum("pi,pi->p", apart, outwards) > 0, 1.0, -1.0)
        inwards = (-sign / np.maximum(distance, 1e-12))[:, None] * apart
        if (on := distance < ON_SURFACE).any():
            inwards[on] = -outwards[on] / np.linalg.norm(outwards[on], axis=1)[:, None]
        arcs = self._arcs[triangle]
        if self._by_sections:
            corners = self._corner_arcs[triangle]
            arcs = corners[:, 0] + v * (corners[:, 1] - corners[:, 0]) + w * (corners[:, 2] - corners[:, 0])
        return ClosestPoints(feet, inwards, -outwards, sign * distance, arcs)

    def edge(
        self, point: Float[np.ndarray, " 3"], up: Float[np.ndarray, " 3"], near: Int[np.ndarray, " triangles"]
    ) -> float:
        """How far a point [m] between the sides of a fold lies below its edge, seen along `up`; negative above it [m].

        `near` are triangles of both sides, which tell whether the point is in the fold at all.
        """
        foot = self.nearest_of(point[None], near[None])
        if foot.outside[0] < 0:
            return float(foot.outside[0])
        height = float(self._rays.cast(point[None], up[None, None])[0, 0])
        return height if height < HIGHEST_FOLD else 0.0

    def middle(self, arc: float) -> Float[np.ndarray, " 3"]:
        """The centreline at an arc length [m]."""
        return self._line.points[np.searchsorted(self._line.arc, arc).clip(0, len(self._line.arc) - 1)]

    def clear(
        self, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], arcs: Float[np.ndarray, " 2"]
    ) -> bool:
        """Whether the straight line between two places [m] meets no wall; arc lengths count where a colon moves."""
        return bool(self._rays.clear(start[None], end[None])[0])


def surface_arcs(colon: Colon) -> Float[np.ndarray, " vertices"]:
    """Arc length of each vertex of a colon's surface [m]: that of the cross-section which it stands in.

    It is looked for near that of the place which the centreline sees along the surface, smooth from vertex to vertex.
    """
    return section_arcs(colon, colon.lumen.vertices, colon.lumen.faces)


def section_arcs(
    colon: Colon, vertices: Float[np.ndarray, "vertices 3"], faces: Int[np.ndarray, "triangles 3"]
) -> Float[np.ndarray, " vertices"]:
    """`surface_arcs` of a surface with those vertices [m], on that of the colon."""
    arcs = _vertex_arcs(colon, vertices, faces)
    edges = _edges(faces)
    beside = coo_array((np.ones(len(edges)), edges.T), shape=(len(vertices), len(vertices))).tocsr()
    beside = beside + beside.T
    count = np.asarray(beside.sum(axis=1)).ravel()
    for _ in range(_SMOOTHINGS):
        arcs = (arcs + beside @ arcs / count) / 2
    return _without_jumps(_into_sections(colon, vertices, arcs), vertices, edges)


def _into_sections(colon: Colon, vertices: np.ndarray, arcs: np.ndarray) -> np.ndarray:
    """Arc lengths near those given at which vertices are neither ahead of nor behind the axis' cross-section [m]."""
    line = colon.centreline
    at, _, tangents = axis_nodes(line.points, line.arc)
    bends = np.diff(tangents, axis=0) / at[1]
    low, high = np.maximum(arcs - _FROM_SEEN, 0.0), np.minimum(arcs + _FROM_SEEN, line.length)
    for _ in range(_SECTION_ROUNDS):
        offset = vertices - _interpolated(arcs, line.arc, line.points)
        tangent = _interpolated(arcs, at, tangents)
        ahead = np.einsum("vi,vi->v", offset, tangent)
        bend = bends[np.minimum((arcs / at[1]).astype(int), len(bends) - 1)]
        room = np.maximum(1 - np.einsum("vi,vi->v", offset, bend), _LEAST_ROOM)
        arcs = np.clip(arcs + np.clip(_SECTION_SHARE * ahead / room, -_LONGEST_STEP, _LONGEST_STEP), low, high)
    return arcs


def _without_jumps(arcs: np.ndarray, vertices: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Arc lengths that change along an edge of the surface by what a bend leaves of it at most (`_LEAST_ROOM`)."""
    most = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1) / _LEAST_ROOM
    for _ in range(_SMOOTHINGS):
        apart = arcs[edges[:, 1]] - arcs[edges[:, 0]]
        jumps = np.flatnonzero(np.abs(apart) > most)
        nearer = (apart[jumps] - np.sign(apart[jumps]) * most[jumps]) / 2
        more, count = np.zeros(len(arcs)), np.zeros(len(arcs))
        for end, way in ((0, nearer), (1, -nearer)):
            np.add.at(more, edges[jumps, end], way)
            np.add.at(count, edges[jumps, end], 1.0)
        arcs = arcs + more / np.maximum(count, 1.0)
    return arcs


def _interpolated(places: np.ndarray, at: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.column_stack([np.interp(places, at, values[:, axis]) for axis in range(values.shape[1])])


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
    edges = _edges(faces)
    length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    graph = coo_array((np.maximum(length, 1e-9), edges.T), shape=(len(vertices), len(vertices))).tocsr()
    _, _, source = dijkstra(graph, directed=False, indices=sources, min_only=True, return_predecessors=True)
    return arc_of[np.asarray(source)]


def _edges(faces: np.ndarray) -> Int[np.ndarray, "edges 2"]:
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def _lid(colon: Colon, centres: Float[np.ndarray, "triangles 3"]) -> np.ndarray:
    """Which triangles close the surface at the anus, where the scope comes in."""
    offset = centres - colon.centreline.points[0]
    axis = colon.centreline.frames[0][:, 2]
    along = offset @ axis
    aside = np.linalg.norm(offset - along[:, None] * axis, axis=1)
    return (along < ANUS) & (aside < ENTRY_RADIUS)


def _packed(corners: Float[np.ndarray, "triangles 3 3"]) -> Float[np.ndarray, "triangles 16"]:
    """What `_closest` needs of each triangle: a corner, two edges from it, and products of the edges."""
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    bb, cc, bc = ((one * other).sum(axis=1) for one, other in ((ab, ab), (ac, ac), (ab, ac)))
    determinant, third = np.maximum(bb * cc - bc * bc, 1e-30), np.maximum(bb - 2 * bc + cc, 1e-30)
    inverse = (1 / np.maximum(bb, 1e-30), 1 / np.maximum(cc, 1e-30), 1 / third)
    return np.column_stack([a, ab, ac, bb, cc, bc, 1 / determinant, *inverse])


def _closest(
    points: Float[np.ndarray, "points 3"], triangles: Float[np.ndarray, "points candidates 16"]
) -> tuple[Int[np.ndarray, " points"], Float[np.ndarray, " points"], Float[np.ndarray, " points"]]:
    """Which candidate is nearest, and the nearest place a + v ab + w ac of it, as v and w (Ericson 2005, 5.1.5).

    Squared distances are |p - a|^2 plus a quadratic in v and w, smallest inside the triangle or on one of its edges.
    """
    offset = points[:, None] - triangles[..., 0:3]
    pb = np.einsum("pci,pci->pc", offset, triangles[..., 3:6])
    pc = np.einsum("pci,pci->pc", offset, triangles[..., 6:9])
    bb, cc, bc, by_determinant, by_bb, by_cc, by_third = (triangles[..., column] for column in range(9, 16))
    v, w = (cc * pb - bc * pc) * by_determinant, (bb * pc - bc * pb) * by_determinant
    inside = (v >= 0) & (w >= 0) & (v + w <= 1)
    on_ab, on_ac, on_bc = _on_edge(pb * by_bb), _on_edge(pc * by_cc), _on_edge((pc - pb - bc + bb) * by_third)
    rest = 1 - on_bc
    costs = (
        np.where(inside, -(v * pb + w * pc), np.inf),
        on_ab * (on_ab * bb - 2 * pb),
        on_ac * (on_ac * cc - 2 * pc),
        rest * (rest * bb - 2 * pb) + on_bc * (on_bc * cc - 2 * pc + 2 * rest * bc),
    )
    least = np.minimum(np.minimum(costs[0], costs[1]), np.minimum(costs[2], costs[3]))
    best = (np.einsum("pci,pci->pc", offset, offset) + least).argmin(axis=1)
    at = (np.arange(len(points)), best)
    way = np.array([cost[at] for cost in costs]).argmin(axis=0)
    zero, far = np.zeros(len(points)), on_bc[at]
    return best, np.choose(way, (v[at], on_ab[at], zero, 1 - far)), np.choose(way, (w[at], zero, on_ac[at], far))


def _on_edge(share: np.ndarray) -> np.ndarray:
    """Within 0 to 1; a tenth of what `np.clip` costs on few numbers."""
    return np.minimum(np.maximum(share, 0.0), 1.0)
