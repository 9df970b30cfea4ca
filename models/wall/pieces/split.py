"""Greedy convex decomposition: cut a block where its hull stands deepest in the lumen, until it is close enough."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from manifold3d import Manifold

from haustra.models.wall.pieces.blocks import SLIVER, Block, corners, crossings, edges
from haustra.models.wall.pieces.cells import Plane

ON_PLANE = 1e-6
"""Distance [m] below which a point counts as lying on a cut: far above rounding, far below any tolerance asked for."""
SMALLEST_FACE = 1e-12
"""Twice the area [m^2] below which a triangle's normal is rounding."""
FLAT = 1e-3
"""Slope below which a ray counts as parallel to a face."""
SAMPLES = np.array([[1, 1, 1], [3, 0, 0], [0, 3, 0], [0, 0, 3]]) / 3
"""Where on a triangle depth is taken: centre and corners, in barycentric coordinates."""
LOST_VOLUME = 1e-6
"""Share of the volume that a cut may lose or gain before it counts as failed."""
DEEPEST_SPLIT = 24
"""Cuts in a row after which a solid counts as one that cannot be cut; there to end degenerate cases."""
HOPELESS = 3.0
"""A solid that cannot be cut is taken up to this many tolerances, and left out beyond: better a gap than a plug."""


class Intrusion(NamedTuple):
    """How far the hull of a solid stands in the lumen."""

    depth: float
    """Largest depth [m]."""
    deepest: Float[np.ndarray, " 3"]
    """Where on the lumen surface that is [m]."""
    surface: Float[np.ndarray, "points 3"]
    """The points of the lumen surface that were looked at [m]."""


def convex_parts(block: Block, *, tolerance: float) -> Iterator[Manifold]:
    """Hulls whose union covers the block and stands at most `tolerance` [m] in the lumen."""
    waiting = [(block.solid, block.planes, 0)]
    while waiting:
        solid, planes, level = waiting.pop()
        hull = solid.hull()
        found = intrusion(solid, hull, planes)
        if found.depth <= tolerance:
            yield hull
            continue
        cuts = _best_cut(solid, found, block) if level < DEEPEST_SPLIT else []
        if not cuts and found.depth <= HOPELESS * tolerance:
            yield hull
        for part, cut in cuts:
            waiting += [(piece, (*planes, cut), level + 1) for piece in part.decompose() if piece.volume() > SLIVER]


def is_convex(block: Block, *, tolerance: float) -> bool:
    """Whether the block's hull stands at most `tolerance` [m] in the lumen."""
    return intrusion(block.solid, block.solid.hull(), block.planes).depth <= tolerance


def intrusion(solid: Manifold, hull: Manifold, planes: tuple[Plane, ...]) -> Intrusion:
    """How deep the hull of a solid stands in the lumen.

    From points of the solid's lumen surface a ray goes into the lumen along the surface's normal; what it runs inside
    the hull is the depth. A thin slice that spans the lumen is left by such rays at once, through its cuts; there the
    hull's volume in the lumen over the lumen surface, which is the mean depth, tells.
    """
    points, normals, area = _lumen_samples(solid, planes)
    if not len(points):
        return Intrusion(0.0, np.zeros(3), points)
    facets, offsets, facing = _planes(hull, planes)
    slope = normals @ facets.T
    height = np.maximum(offsets - points @ facets.T, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(slope > FLAT, height / slope, np.inf).min(axis=1)
    if facing.any():
        depth = np.minimum(depth, height[:, facing].min(axis=1))
    worst = int(depth.argmax())
    mean = (hull.volume() - solid.volume()) / area
    return Intrusion(max(float(depth[worst]), mean), points[worst], points)


def _best_cut(solid: Manifold, intrusion: Intrusion, block: Block) -> list[tuple[Manifold, Plane]]:
    """The cut, among a few natural ones, that leaves the least hull outside the solid; none where all fail."""
    points = intrusion.surface
    low, high = points.min(axis=0), points.max(axis=0)
    vertices, rims = corners(solid), edges(solid)
    for places in ((intrusion.deepest, 0.5 * (low + high)), (0.7 * low + 0.3 * high, 0.3 * low + 0.7 * high)):
        found = [
            (left, *plane)
            for plane in _candidates(points, places, block)
            if (left := _hulls_volume(vertices, rims, plane)) is not None
        ]
        for _, normal, offset in sorted(found, key=lambda cut: cut[0]):
            parts = solid.split_by_plane(tuple(normal), offset)
            volumes = [part.volume() for part in parts]
            # Cutting a solid that touches itself can go wrong; the volumes tell.
            if min(volumes) > 0 and abs(sum(volumes) - solid.volume()) <= LOST_VOLUME * solid.volume():
                return [(parts[0], (-normal, -offset)), (parts[1], (normal, offset))]
    return []


def _hulls_volume(vertices: np.ndarray, rims: np.ndarray, plane: Plane) -> float | None:
    """Volume of the hulls of both sides of a cut [m^3], without making it; None where one side is empty.

    The solid's own volume is the same for every cut, so the least sum of the hulls leaves the least of them outside it.
    """
    normal, offset = plane
    height = vertices @ normal - offset
    above = height > 0
    if above.all() or not above.any():
        return None
    crossing = crossings(vertices, rims, height)
    return sum(Manifold.hull_points(np.concatenate([vertices[side], crossing])).volume() for side in (above, ~above))


def _candidates(points: np.ndarray, places: tuple[np.ndarray, ...], block: Block) -> Iterator[Plane]:
    """Planes across and along the axis, and parallel to the wall, through each of the places."""
    site = block.site
    outwards = points.mean(axis=0) - site.point
    axis = site.frame[:, 2]
    outwards = outwards - (outwards @ axis) * axis
    outwards = outwards / max(np.linalg.norm(outwards), 1e-12)
    around = np.cross(axis, outwards)
    for through in places:
        for normal in (axis, around, outwards):
            yield normal, float(normal @ through)


def face_planes(hull: Manifold) -> tuple[Plane, ...]:
    """The half-spaces that a hull is the intersection of."""
    return tuple((normal, float(offset)) for normal, offset in zip(*_planes(hull, ())[:2], strict=True))


def _planes(hull: Manifold, cuts: tuple[Plane, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit normals and offsets of a hull's faces, and which of them lie on no cut."""
    vertices, faces, free = _faces(hull, cuts)
    normals, twice = face_normals(vertices[faces])
    sound = twice > SMALLEST_FACE
    return normals[sound], np.einsum("ij,ij->i", normals[sound], vertices[faces[sound, 0]]), free[sound]


def _lumen_samples(solid: Manifold, planes: tuple[Plane, ...]) -> tuple[np.ndarray, np.ndarray, float]:
    """Points on the lumen surface (the faces that lie on no cut), its normals there, into the lumen, and its area."""
    vertices, faces, free = _faces(solid, planes)
    normals, twice = face_normals(vertices[faces[free]])
    points = np.einsum("sk,fkd->sfd", SAMPLES, vertices[faces[free]]).reshape(-1, 3)
    return points, np.tile(normals, (len(SAMPLES), 1)), max(0.5 * float(twice.sum()), SMALLEST_FACE)


def _faces(solid: Manifold, cuts: tuple[Plane, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices and faces of a solid, and which faces lie on no cut."""
    mesh = solid.to_mesh64()
    vertices = np.asarray(mesh.vert_properties)[:, :3]
    faces = np.asarray(mesh.tri_verts).astype(np.int64)
    normals = np.array([normal for normal, _ in cuts]).reshape(-1, 3)
    on = np.abs(vertices @ normals.T - np.array([offset for _, offset in cuts])) < ON_PLANE
    a, b, c = (on[faces[:, k]] for k in range(3))
    return vertices, faces, ~np.any(a & b & c, axis=1)


def face_normals(triangles: Float[np.ndarray, "faces 3 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals and twice the areas [m^2] of triangles."""
    a, b, c = (triangles[:, k] for k in range(3))
    (ux, uy, uz), (vx, vy, vz) = (b - a).T, (c - a).T
    # Written out: np.cross takes three times as long for the few faces of one part.
    normal = np.stack([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], axis=1)
    twice = np.sqrt(np.einsum("ij,ij->i", normal, normal))
    return normal / np.maximum(twice, SMALLEST_FACE)[:, None], twice
