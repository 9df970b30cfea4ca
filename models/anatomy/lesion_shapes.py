"""The shapes of lesions: strictures narrow the rings of a tube, polyps and diverticula are cut into its surface."""

import manifold3d
import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidMeshError
from haustra.models.anatomy.colon import Lesion, Surface
from haustra.models.anatomy.lesion import stricture_length
from haustra.models.anatomy.lesion_placing import Placer, Spot
from haustra.models.anatomy.rays import LumenRays

SHOULDER = 0.015
"""Length over which a stricture opens to the lumen on either side [m]."""
NARROWER = 0.9
"""A stricture's throat is narrower than this share of the lumen before."""
HEADROOM = 0.7
"""Share of the way from the wall to the centreline that a polyp may take: the centreline stays inside the lumen."""
SESSILE_HEIGHT, FLAT_HEIGHT = 0.5, 2e-3
"""Height of a sessile polyp over its width, and of a flat one [m]: Paris 0-IIa rises less than 2.5 mm."""
STALK_WIDTH, STALK_LENGTH, LEAST_STALK = 0.35, 0.7, 2e-3
"""Width and length of a stalk over the head's width, and the shortest one [m]."""
SKIRT = 3e-3
"""Depth to which a polyp's foot goes on below its place [m], for walls that fall away: less than the loops' gap."""
NECK_WIDTH, NECK_LENGTH, NECK_INSIDE = 0.6, 1.5e-3, 2e-3
"""Width of a diverticulum's neck over its sac's, its length outside the wall [m], and how far it starts inside [m]."""
WALL_LEFT = 1.5e-3
"""Tissue that is left between a diverticulum's sac and any other lumen [m]."""
ROUND = 28
"""Corners of a lesion's cross-section."""
SLIVER_MM = 0.02
"""Edges shorter than this are collapsed after cutting [mm]: rounding must not turn a sliver over."""

CUT_RESOLUTION = 1e-8
"""Vertices are rounded to this after cutting [m]: finer than the tube's, since cutting leaves thin triangles."""


def narrow(
    placer: Placer, arc: Float[np.ndarray, " rings"], radius: Float[np.ndarray, "rings angles"]
) -> tuple[Float[np.ndarray, "rings angles"], list[Lesion]]:
    """Put the strictures that were ordered into the rings at `arc` [m]; radii in [m]."""
    lesions, length = [], stricture_length()
    for order in placer.wanted("stricture"):
        for spot in placer.spots(order):
            extent = float(length.low + spot.chance * (length.high - length.low))
            away = np.abs(arc - spot.arc) - extent / 2
            middle = np.array([np.interp(spot.arc, placer.line.arc, axis) for axis in placer.line.points.T])
            wide = 2 * np.sqrt((radius[away < 0] ** 2).mean())
            inside = extent / 2 + SHOULDER < min(spot.arc, placer.line.length - spot.arc)
            if inside and spot.size < NARROWER * wide and placer.free(middle, extent / 2 + SHOULDER):
                share = np.cos(np.pi / 2 * np.clip(away / SHOULDER, 0, 1))[:, None] ** 2
                radius = (1 - share) * radius + share * spot.size / 2
                lesions.append(placer.take(spot, extent=extent, angle=None, position=middle))
                break
    return radius, lesions


def add_solids(placer: Placer, lumen: Surface) -> tuple[Surface, list[Lesion]]:
    """Cut the polyps and diverticula that were ordered into a closed lumen without handles."""
    wanted = placer.wanted("diverticulum", "polyp")
    if not wanted:
        return lumen, []
    rays, solid, lesions = LumenRays(lumen), _solid(lumen), []
    for order in wanted:
        for spot in placer.spots(order):
            foot, inwards, room = _foot(placer, rays, spot)
            height = _height(spot, room)
            if height is None or not placer.free(foot, spot.size / 2):
                continue
            changed = _cut(solid, spot, height, foot, inwards)
            if changed is not None:
                solid = changed
                lesions.append(placer.take(spot, extent=height, angle=spot.angle, position=foot))
                break
    return _surface(solid), lesions


def _foot(placer: Placer, rays: LumenRays, spot: Spot) -> tuple[np.ndarray, np.ndarray, float]:
    """Place on the wall [m], direction into the lumen, and distance to the centreline [m]."""
    line = placer.line
    station = int(np.argmin(np.abs(line.arc - spot.arc)))
    outwards = line.frames[station, :, :2] @ np.array([np.cos(spot.angle), np.sin(spot.angle)])
    room = float(rays.cast(line.points[[station]], outwards[None, None])[0, 0])
    room = room if np.isfinite(room) else 0.0
    return line.points[station] + room * outwards, -outwards, room


def _height(spot: Spot, room: float) -> float | None:
    """Height of a polyp or depth of a diverticulum [m]; None when the polyp would reach too far into the lumen."""
    size = spot.size
    if spot.order.kind == "diverticulum":
        return NECK_LENGTH + size / 2 + np.sqrt(1 - NECK_WIDTH**2) * size / 2
    if spot.order.type == "flat":
        height = min(FLAT_HEIGHT, 0.4 * size)
    elif spot.order.type == "sessile":
        height = SESSILE_HEIGHT * size
    else:
        height = min(size + STALK_LENGTH * size, HEADROOM * room)
        if height < size + LEAST_STALK:
            return None
    return height if height <= HEADROOM * room else None


def _cut(
    solid: manifold3d.Manifold, spot: Spot, height: float, foot: np.ndarray, inwards: np.ndarray
) -> manifold3d.Manifold | None:
    """The lumen with the lesion, or None where that would leave a handle, an island or too thin a wall."""
    polyp = spot.order.kind == "polyp"
    if not polyp and not _whole(solid + _placed(_sac(spot.size + 2 * WALL_LEFT, spot.size), foot, -inwards)):
        return None
    if polyp:
        changed = solid - _placed(_polyp(spot.order.type, spot.size, height), foot, inwards)
    else:
        changed = solid + _placed(_sac(spot.size, spot.size), foot, -inwards)
    return changed if _whole(changed) else None


def cut_open(
    lumen: Surface, outline: Float[np.ndarray, "corners 2"], foot: Float[np.ndarray, "3"], axis: Float[np.ndarray, "3"]
) -> Surface | None:
    """The lumen with a solid of revolution added to it, None where that would leave a handle or an island.

    Args:
        lumen: a closed surface without handles [m].
        outline: of the solid, distance from its axis and height along it [m].
        foot: where its height is zero [m].
        axis: unit vector.
    """
    changed = _solid(lumen) + _placed(outline, foot, axis)
    return _surface(changed) if _whole(changed) else None


def _whole(solid: manifold3d.Manifold) -> bool:
    return len(solid.decompose()) == 1 and solid.genus() == 0


def lesion_outline(lesion: Lesion) -> Float[np.ndarray, "corners 2"]:
    """Outline of a polyp or diverticulum as it was cut: distance from its axis, and height or depth [m]."""
    return _polyp(lesion.type, lesion.size, lesion.extent) if lesion.kind == "polyp" else _sac(lesion.size, lesion.size)


def _polyp(shape: str, width: float, height: float) -> np.ndarray:
    """Outline of a polyp, distance from its axis and height [m]."""
    quarter = np.linspace(0, np.pi / 2, 9)
    if shape == "pedunculated":
        stalk = STALK_WIDTH * width / 2
        turn = np.linspace(np.arcsin(2 * stalk / width) - np.pi / 2, np.pi / 2, 13)
        turn[0] = np.arccos(2 * stalk / width) * -1
        head = np.stack([width / 2 * np.cos(turn), height - width / 2 + width / 2 * np.sin(turn)], axis=1)
        return np.concatenate([[[0, -SKIRT], [stalk, -SKIRT]], head[:-1], [[0, height]]])
    dome = np.stack([width / 2 * np.cos(quarter), height * np.sin(quarter)], axis=1)
    return np.concatenate([[[0, -SKIRT], [width / 2, -SKIRT]], dome[:-1], [[0, height]]])


def _sac(width: float, usual: float) -> np.ndarray:
    """Outline of a diverticulum, distance from its axis and depth [m]; its neck is that of the `usual` width."""
    neck, half = NECK_WIDTH * usual / 2, width / 2
    centre = NECK_LENGTH + np.sqrt(1 - NECK_WIDTH**2) * usual / 2
    turn = np.linspace(-np.arccos(neck / half), np.pi / 2, 13)
    sac = np.stack([half * np.cos(turn), centre + half * np.sin(turn)], axis=1)
    start = [[0, -NECK_INSIDE], [neck, -NECK_INSIDE]]
    return np.concatenate([start, sac[sac[:, 1] > -NECK_INSIDE + 1e-4][:-1], [[0, centre + half]]])


def _placed(outline: np.ndarray, foot: np.ndarray, axis: np.ndarray) -> manifold3d.Manifold:
    """The outline turned about its axis, in mm, since the library's polygons keep few decimals."""
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.sqrt((side * side).sum())
    frame = np.stack([side, np.cross(axis, side), axis, 1e3 * foot], axis=1)
    section = manifold3d.CrossSection([1e3 * outline])
    return manifold3d.Manifold.revolve(section, ROUND).transform(frame)


def _solid(lumen: Surface) -> manifold3d.Manifold:
    vertices = np.ascontiguousarray(1e3 * lumen.vertices)
    return manifold3d.Manifold(manifold3d.Mesh64(vert_properties=vertices, tri_verts=lumen.faces.astype(np.uint64)))


def _surface(solid: manifold3d.Manifold) -> Surface:
    mesh = solid.simplify(SLIVER_MM).to_mesh64()
    vertices = np.round(1e-3 * np.asarray(mesh.vert_properties)[:, :3] / CUT_RESOLUTION) * CUT_RESOLUTION + 0.0
    surface = Surface(vertices=vertices, faces=np.asarray(mesh.tri_verts).astype(np.int64))
    if _solid(surface).status() != manifold3d.Error.NoError:
        raise InvalidMeshError("Cutting the lesions did not leave a closed surface: take another seed.")
    return surface
