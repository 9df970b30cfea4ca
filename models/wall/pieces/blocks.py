"""Blocks: each cell cut into sectors around the centreline, with the lumen taken out."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from manifold3d import Manifold, Mesh64

from haustra.errors import InvalidMeshError
from haustra.models.anatomy.colon import Colon
from haustra.models.wall.pieces.cells import Cell, Plane, Site

ENTRY_RADIUS = 0.012
"""Radius [m] of the way in before the anal end of the centreline: room for a 13 mm scope that is not quite centred."""
ENTRY_REACH = 0.150
"""How far back from the anal end that way is kept free [m]: beyond any wall that stands around it."""
ENTRY_SIDES = 32
TISSUE = 0.001
"""Least tissue [m] between two loops or the sides of a fold: where surfaces touch they are moved apart to this."""
SWELLING = 1.05
"""By how much the lumen is cropped larger than a cell."""
SLIVER = 2e-9
"""Volume [m^3] below which a solid is dropped: 2 mm^3 hold nothing up and make poor hulls."""


@dataclass(frozen=True)
class Block:
    """A solid piece of the wall, not convex as yet, inside a convex region."""

    solid: Manifold
    """One connected solid, outside the lumen."""
    planes: tuple[Plane, ...]
    """Half-spaces of the convex region it was cut from: faces on these are cuts, all others are lumen surface."""
    site: Site
    """Its stretch of the centreline."""


def lumen_solid(colon: Colon, *, widening: float, simplification: float) -> Manifold:
    """The space that stays free: the lumen, widened by `widening` [m] along its normals, and the way in at the anus.

    Convex pieces err towards the lumen only; widening it by their mean error first makes the error two-sided, while
    neighbouring pieces still meet in the same corners. Where less than `TISSUE` would stay it is narrowed instead. It
    is then simplified by up to `simplification` [m].

    Raises:
        InvalidMeshError: when the lumen surface bounds no solid.
    """
    vertices = colon.lumen.vertices
    faces = colon.lumen.faces
    if widening:
        normals = vertex_normals(vertices, faces)
        spare = 0.5 * (_tissue(colon, normals, TISSUE + 2 * widening) - TISSUE)
        vertices = vertices + normals * np.minimum(widening, spare)[:, None]
    solid = Manifold(Mesh64(np.ascontiguousarray(vertices), faces.astype(np.uint64)))
    if solid.is_empty() or solid.volume() <= 0:
        raise InvalidMeshError(
            f"The lumen of colon '{colon.name}' bounds no solid ({solid.status()}): import it again to repair it."
        )
    return solid.simplify(simplification) + entry_way(colon)


def entry_way(colon: Colon) -> Manifold:
    """The cylinder through which a scope comes, from the anal end of the centreline backwards along its tangent."""
    line = colon.centreline
    frame = line.frames[0]
    # A cylinder points along its third axis; turned by half a turn about the first normal it points out of the patient.
    backwards = np.column_stack([frame[:, 0], -frame[:, 1], -frame[:, 2]])
    cylinder = Manifold.cylinder(ENTRY_REACH, ENTRY_RADIUS, ENTRY_RADIUS, ENTRY_SIDES)
    return cylinder.transform(np.column_stack([backwards, line.points[0]]))


def cut_blocks(cell: Cell, lumen: Manifold, *, sectors: int, thickness: float) -> Iterator[Block]:
    """Cut a cell into sectors around its axis, each reaching `thickness` [m] beyond the lumen, without the lumen."""
    site = cell.site
    # Cropped to more than the cell: solids with faces in common subtract badly.
    near = lumen ^ _swollen(cell.region)
    inside = near ^ cell.region
    if inside.is_empty():
        return
    surface, rims = corners(inside), edges(inside)
    angles = 2 * np.pi * np.arange(sectors + 1) / sectors
    for low, high in pairwise(angles):
        wedge = [_half_plane(site, low, -1.0), _half_plane(site, high, 1.0)]
        own = _within(surface, rims, wedge)
        if not len(own):
            continue
        outwards = site.frame[:, :2] @ _unit(0.5 * (low + high))
        wedge.append((outwards, float((own @ outwards).max()) + thickness))
        planes = cell.planes + tuple(wedge)
        for solid in (_trim(cell.region, wedge) - near).decompose():
            if solid.volume() > SLIVER:
                yield Block(solid, planes, site)


def corners(solid: Manifold) -> Float[np.ndarray, "vertices 3"]:
    """Vertices of a solid [m]."""
    return np.asarray(solid.to_mesh64().vert_properties)[:, :3]


def edges(solid: Manifold) -> Int[np.ndarray, "edges 2"]:
    """Vertices at the ends of each edge of a solid, each edge once."""
    faces = np.asarray(solid.to_mesh64().tri_verts).astype(np.int64)
    around = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return around[around[:, 0] < around[:, 1]]


def crossings(
    vertices: Float[np.ndarray, "vertices 3"], edges: Int[np.ndarray, "edges 2"], height: Float[np.ndarray, " vertices"]
) -> Float[np.ndarray, "points 3"]:
    """Where edges pass through a plane [m], from the height [m] of their vertices above it."""
    above = height > 0
    start, end = edges[above[edges[:, 0]] != above[edges[:, 1]]].T
    share = height[start] / (height[start] - height[end])
    return vertices[start] + share[:, None] * (vertices[end] - vertices[start])


def vertex_normals(vertices: Float[np.ndarray, "vertices 3"], faces: np.ndarray) -> Float[np.ndarray, "vertices 3"]:
    """Outward unit normals, weighted by area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    total = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(total, faces[:, k], normal)
    return total / np.maximum(np.linalg.norm(total, axis=1), 1e-30)[:, None]


def _tissue(colon: Colon, normals: np.ndarray, furthest: float) -> np.ndarray:
    """Thickness of the tissue outwards of each vertex [m], up to another loop or a fold, or `furthest`."""
    from haustra.models.wall.pieces.rays import (
        Caster,  # here, since children that only split blocks start faster without
    )

    caster = Caster(colon.lumen)
    step = 1e-6  # off the surface, so that a ray does not meet its own triangle
    return np.array(
        [
            min(caster.reach(vertex + step * normal, normal), furthest)
            for vertex, normal in zip(colon.lumen.vertices, normals, strict=True)
        ]
    )


def _swollen(region: Manifold) -> Manifold:
    """A convex solid, a little larger about its middle."""
    middle = corners(region).mean(axis=0)
    return region.translate(tuple(-middle)).scale((SWELLING, SWELLING, SWELLING)).translate(tuple(middle))


def _within(vertices: np.ndarray, edges: np.ndarray, wedge: list[Plane]) -> np.ndarray:
    """Corners of a solid's surface cut to a wedge, but for those on the wedge's own edge: nothing lies further in."""
    heights = [vertices @ normal - offset for normal, offset in wedge]
    points = [vertices[(heights[0] <= 0) & (heights[1] <= 0)]]
    for height, (normal, offset) in zip(heights, reversed(wedge), strict=True):
        crossing = crossings(vertices, edges, height)
        points.append(crossing[crossing @ normal <= offset])
    return np.concatenate(points)


def _half_plane(site: Site, angle: float, sign: float) -> Plane:
    """The plane through the axis at `angle`, facing towards larger angles for sign 1."""
    normal = sign * (site.frame[:, :2] @ _unit(angle + 0.5 * np.pi))
    return normal, float(normal @ site.point)


def _unit(angle: float) -> np.ndarray:
    return np.array([np.cos(angle), np.sin(angle)])


def _trim(solid: Manifold, planes: list[Plane]) -> Manifold:
    for normal, offset in planes:
        solid = solid.trim_by_plane(tuple(-normal), -offset)
    return solid
