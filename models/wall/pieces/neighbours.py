"""Whose lumen a piece stands in: its own, or that of another loop that lies beside it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from jaxtyping import Float, Int
from manifold3d import Manifold, Mesh64
from scipy.spatial import KDTree

from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.wall.pieces.blocks import vertex_normals
from haustra.models.wall.pieces.distance import Faces
from haustra.models.wall.pieces.rays import Caster
from haustra.models.wall.pieces.wall import WallPiece
from haustra.models.wall.signed_distance import surface_arcs

OTHER_LOOP = 0.100
"""Difference of arc length [m] from which on another stretch of the colon counts as another loop."""
SPACING = 0.0015
"""Faces are looked at in parts that circles of this radius [m] hold: a lumen 15 mm wide bulges 0.15 mm in one."""
OUTSIDE = 0.0001
"""What is further [m] outside a neighbour's surface, by its nearest vertex's normal, is not looked at."""
LONGEST_EDGE = 0.004
"""The lumen's triangles are divided until no edge is longer [m]: then the nearest vertex's normal tells the side."""
ROUNDING = 1e-5
"""Depth [m] in a lumen that is none: pieces are cut along its surface."""
ASKEW = np.array([[0.36, 0.48, 0.8]])
"""A unit vector along no axis: rays along axes meet edges of surfaces that were made from voxels."""


@dataclass(frozen=True)
class Standing:
    """Points of pieces that stand in another loop's lumen, the deepest first; some at its edges may be beside it."""

    points: Float[np.ndarray, "points 3"]
    """Where they are [m]."""
    depth: Float[np.ndarray, " points"]
    """Distance from the lumen surface [m]."""
    pieces: Int[np.ndarray, " points"]
    """The number of each one's piece."""


class Neighbours:
    """The lumen of a colon with the arc length of each place of its surface."""

    def __init__(self, colon: Colon):
        """Label the surface."""
        labelled = np.column_stack([colon.lumen.vertices, surface_arcs(colon)])
        faces = np.ascontiguousarray(colon.lumen.faces.astype(np.uint64))
        self.solid = Manifold(Mesh64(vert_properties=np.ascontiguousarray(labelled), tri_verts=faces)).as_original()
        """The lumen; arc lengths of its surface are a property of its vertices, which cuts carry on."""
        mesh = self.solid.refine_to_length(LONGEST_EDGE).to_mesh64()
        self._lumen = Surface(
            np.ascontiguousarray(mesh.vert_properties[:, :3]), np.asarray(mesh.tri_verts).astype(np.int64)
        )
        self._arcs = np.array(mesh.vert_properties[:, 3])
        self._tree = KDTree(self._lumen.vertices)
        self._faces = Faces(self._lumen)
        self._normals = vertex_normals(self._lumen.vertices, self._lumen.faces)

    def standing(self, pieces: Sequence[WallPiece]) -> Standing:
        """Where pieces stand in the lumen of another loop than their own."""
        points, owners, ends = [np.zeros((0, 3))], [np.zeros(0, np.int64)], [np.zeros((0, 2))]
        for key, group in groupby(enumerate(pieces), key=lambda item: (item[1].start, item[1].end)):
            numbers, members = zip(*group, strict=True)
            near, owner = self._near([piece.vertices for piece in members], *key)
            points.append(near)
            owners.append(np.array(numbers)[owner])
            ends.append(np.tile(key, (len(near), 1)))
        places, owner, (start, end) = np.concatenate(points), np.concatenate(owners), np.concatenate(ends).T
        if not len(places):
            return Standing(places, np.zeros(0), owner)
        depth, face = self._faces.nearest(places)
        corners = self._lumen.faces[face]
        strange = another_loop(self._arcs[corners].mean(axis=1), start, end)
        inside = self._beneath(places, corners) & strange & (depth > ROUNDING)
        order = np.flatnonzero(inside)[np.argsort(-depth[inside])]
        return Standing(places[order], depth[order], owner[order])

    def _near(self, pieces: list[np.ndarray], start: float, end: float) -> tuple[np.ndarray, np.ndarray]:
        """Points of the pieces' faces in or next to the lumen of other loops, and the piece of each.

        Faces are halved until they are smaller than `SPACING` or lie outside by more than their own size.
        """
        corners = np.concatenate(pieces)
        low, high = corners.min(axis=0) - LONGEST_EDGE, corners.max(axis=0) + LONGEST_EDGE
        middle, half = 0.5 * (low + high), 0.5 * float((high - low).max())
        held = np.array(self._tree.query_ball_point(middle, half, p=np.inf, return_sorted=True), np.int64)
        vertices = self._lumen.vertices[held]
        held = held[((vertices > low) & (vertices < high)).all(axis=1) & another_loop(self._arcs[held], start, end)]
        if not len(held):
            return np.zeros((0, 3)), np.zeros(0, np.int64)
        vertices, normals = self._lumen.vertices[held], self._normals[held]
        tree = KDTree(vertices)
        starts = np.cumsum([0, *(len(piece) for piece in pieces[:-1])])
        lowest, highest = np.minimum.reduceat(corners, starts), np.maximum.reduceat(corners, starts)
        middle, size = 0.5 * (lowest + highest), 0.5 * np.linalg.norm(highest - lowest, axis=1)
        kept = np.flatnonzero(tree.query(middle)[0] < size + LONGEST_EDGE)
        meshes = [Manifold.hull_points(pieces[number]).to_mesh64() for number in kept]
        triangles = np.concatenate([np.zeros((0, 3, 3)), *(mesh.vert_properties[mesh.tri_verts] for mesh in meshes)])
        owners = np.repeat(kept, [len(mesh.tri_verts) for mesh in meshes])
        points, found = [np.zeros((0, 3))], [np.zeros(0, np.int64)]
        while len(triangles):
            centres = triangles.mean(axis=1)
            radius = np.linalg.norm(triangles - centres[:, None], axis=2).max(axis=1)
            distance, nearest = tree.query(centres)
            outside = np.einsum("ij,ij->i", centres - vertices[nearest], normals[nearest])
            kept = outside < np.where(distance > radius + LONGEST_EDGE, 0.0, radius + OUTSIDE)
            kept[kept] = self._nearer(centres[kept], radius[kept], distance[kept])
            triangles, owners, small = triangles[kept], owners[kept], radius[kept] < SPACING
            last = triangles[small].reshape(-1, 3)
            nearest = tree.query(last)[1]
            beside = np.einsum("ij,ij->i", last - vertices[nearest], normals[nearest]) < OUTSIDE
            points.append(last[beside])
            found.append(np.repeat(owners[small], 3)[beside])
            triangles, owners = _halved(triangles[~small]), np.repeat(owners[~small], 2)
        return np.concatenate(points), np.concatenate(found)

    def _nearer(self, middle: np.ndarray, size: np.ndarray, distance: np.ndarray) -> np.ndarray:
        """Which balls may hold a point nearer to another loop's surface, `distance` from the middle, than to all else.

        That surface alone is not closed: seen from its rim, all that is beside it would seem to be inside.
        """
        own = self._tree.query(middle, distance_upper_bound=float(distance.max(initial=0.0)) + ROUNDING)[0]
        return distance < own + 2 * size + LONGEST_EDGE

    def _beneath(self, points: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """Which points lie inside by the plane of their nearest face, or by its corners' normals."""
        offsets = points[:, None] - self._lumen.vertices[corners]
        a, b, c = np.moveaxis(self._lumen.vertices[corners], 1, 0)
        by_corners = np.einsum("pki,pki->p", offsets, self._normals[corners])
        by_face = np.einsum("pi,pi->p", offsets[:, 0], np.cross(b - a, c - a))
        return (by_face < 0) | (by_corners < 0)


def deepest(standing: Standing, lumen: Caster) -> float:
    """The depth [m] of the deepest point that rays at the lumen find inside it as well; 0 where there is none."""
    for point, depth in zip(standing.points, standing.depth, strict=True):
        if lumen.entry(point, ASKEW)[0] == 0.0:
            return float(depth)
    return 0.0


def another_loop(arcs: Float[np.ndarray, " places"], start, end) -> np.ndarray:
    """Which places of the lumen [m along it] lie in another loop than a stretch of it."""
    return (arcs < start - OTHER_LOOP) | (arcs > end + OTHER_LOOP)


def _halved(triangles: Float[np.ndarray, "faces 3 3"]) -> Float[np.ndarray, "halves 3 3"]:
    """Each triangle cut in two across its longest side, side by side."""
    sides = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
    turned = (sides.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(triangles, turned[:, :, None], axis=1), 1, 0)
    middle = 0.5 * (a + b)
    return np.stack([a, middle, c, middle, b, c], axis=1).reshape(-1, 3, 3)
