"""The wall as a table: how far from the centreline a device's middle may be, at every arc length and angle.

The lumen is shrunk by the device's radius, so that a sphere that touches the wall is a point on the shrunk surface.
That surface is tabulated over arc length and angle around the centreline, with its normal. Looking a point up takes a
few dozen operations and no search, has no seams, and is the same code in numpy and in JAX, where it is differentiable.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import CubicSpline

from haustra.errors import UnsupportedSceneError
from haustra.models.anatomy.colon import Colon
from haustra.models.wall import mesentery
from haustra.models.wall.mesentery import Mesentery
from haustra.models.wall.signed_distance import LumenDistance

STATION_STEP = 0.0025
"""Distance between tabulated stations [m]; engineering choice, a seventh of the tightest bends' radius."""
ANGLES = 48
"""Tabulated angles: 2 mm apart at a radius of 16 mm; engineering choice."""
WINDOW = 0.01
"""Largest change of a point's arc length from one look to the next [m]: more than a device moves in a step, and less
than the way round to the next loop."""
LEAST_RADIUS = 2e-4
"""Where a device does not fit, its middle is held this near the centreline [m]; `LumenTable.narrow` says where."""
LEAST_SLOPE = 0.2
"""Least cosine between the ray and the wall's normal: beyond, the ray grazes the wall and the depth along the normal is
not known from it."""
MOST_RADIUS = 0.06
"""No lumen is wider: rays that leave through the anus end here [m]."""
_MARCH = 24
_PROBES = 4000


class Tables(NamedTuple):
    """The arrays of one colon, or of several one after the other: a tree that JAX maps over."""

    points: Any
    """(stations, 3): the centreline [m]."""
    frames: Any
    """(stations, 3, 3): columns are first normal, second normal, tangent."""
    wall: Any
    """(stations, angles, 4): largest radius of the device's middle [m], and the wall's inward normal, in the frame."""
    step: Any
    """Distance between stations [m]: one number, or one a colon."""
    first: Any
    """Index of the colon's first station: one number, or one a colon."""
    count: Any
    """Stations of the colon: one number, or one a colon."""
    axes: Any
    """(3, 3): columns are the axes of these coordinates in the colon's own; one a colon when stacked."""
    device_radius: Any
    """Radius of the spheres that the wall is for [m]: one number, or one a colon."""
    mesentery: Mesentery | None = None
    """How the colon may move; None: it is fixed in space."""


class WallQuery(NamedTuple):
    """Where points stand against the wall."""

    arcs: Any
    """Arc length of each point [m]."""
    depth: Any
    """How deep the device's surface is in the wall there, along the normal [m]; negative for room."""
    inwards: Any
    """Unit normals of the wall, into the lumen."""


@dataclass(frozen=True)
class TableAccuracy:
    """How far the table's depth and normal are from the exact ones of the lumen surface."""

    depth_p50: float
    """Median error of depth [m]."""
    depth_p95: float
    """95th percentile [m]."""
    depth_mean: float
    """Mean signed error [m]; positive presses more than it should."""
    normal_p95_deg: float
    """95th percentile of the angle between normals [degrees]."""
    probes: int
    """Random places that were compared, at most 3 mm from touching on either side."""


@dataclass(frozen=True)
class LumenTable:
    """A colon's table for devices of one radius."""

    tables: Tables
    """In double precision, in the colon's own coordinates."""
    device_radius: float
    """Radius of the device's spheres [m]."""
    error: TableAccuracy
    """Against the lumen surface."""
    narrow: tuple[float, ...]
    """Arc lengths of stations where the device does not fit without pressing on all sides [m]."""

    @property
    def length(self) -> float:
        """Length of the tabulated centreline [m]."""
        return float(self.tables.step * (self.tables.count - 1))

    def seen_from(self, origin: Float[np.ndarray, "3"], axes: Float[np.ndarray, "3 3"]) -> Tables:
        """The tables in coordinates that begin at `origin` [m], with the columns of `axes` as axes.

        With the entry as origin and its direction as last axis, colons can take turns in front of one device.
        """
        own = self.tables
        return own._replace(
            points=(own.points - origin) @ axes,
            frames=np.einsum("ij,sik->sjk", axes, own.frames),
            axes=own.axes @ axes,
            mesentery=own.mesentery and mesentery.seen_from(own.mesentery, origin, axes),
        )


def stack(tables: Sequence[Tables]) -> Tables:
    """Tables of several colons as one; `pick` chooses among them.

    Raises:
        UnsupportedSceneError: when some may move and some not.
    """
    moving = [one.mesentery for one in tables if one.mesentery is not None]
    if moving and len(moving) < len(tables):
        raise UnsupportedSceneError("Either all colons of a batch move on their mesentery, or none: make two batches.")
    counts = [int(one.count) for one in tables]
    return Tables(
        *(np.concatenate([getattr(one, name) for one in tables]) for name in ("points", "frames", "wall")),
        step=np.array([float(one.step) for one in tables]),
        first=np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int32),
        count=np.array(counts, np.int32),
        axes=np.stack([one.axes for one in tables]),
        device_radius=np.array([float(one.device_radius) for one in tables]),
        mesentery=mesentery.stack(moving) if moving else None,
    )


def pick(tables: Tables, colons: Int[Any, " worlds"]) -> Tables:
    """One colon a world, for `touch` with points of shape (worlds, points, 3); of the wall, nothing is copied."""
    moving = tables.mesentery and Mesentery(*(part[colons] for part in tables.mesentery))
    chosen = {name: getattr(tables, name)[colons][:, None] for name in ("step", "first", "count", "device_radius")}
    return tables._replace(**chosen, axes=tables.axes[colons], mesentery=moving)


def lumen_table(
    colon: Colon,
    *,
    device_radius: float,
    surface: LumenDistance | None = None,
    seed: int = 0,
    with_mesentery: bool = False,
) -> LumenTable:
    """Tabulate a colon's wall for spheres of one radius.

    Args:
        colon: the colon.
        device_radius: radius of the spheres [m].
        surface: the colon's exact surface, when it is there already.
        seed: of the places where the error is measured.
        with_mesentery: let the colon move on its mesentery; otherwise it is fixed in space.
    """
    surface = surface or LumenDistance(colon)
    points, frames, step = _stations(colon)
    arcs = step * np.arange(len(points))
    angles = 2 * np.pi * np.arange(ANGLES) / ANGLES
    rays = np.einsum("sij,aj->sai", frames[:, :, :2], np.column_stack([np.cos(angles), np.sin(angles)]))
    radius = _first_touch(surface, points, rays, arcs, device_radius)
    places = points[:, None] + np.maximum(radius, LEAST_RADIUS)[..., None] * rays
    feet = surface.nearest(places.reshape(-1, 3), np.repeat(arcs, ANGLES))
    inwards = feet.inwards.reshape(len(points), ANGLES, 3)
    # Where the ray grazes the wall, or the device does not fit, the wall stands across the ray.
    grazing = np.einsum("sai,sai->sa", inwards, -rays) < LEAST_SLOPE
    inwards[grazing] = -rays[grazing]
    local = np.einsum("sij,sai->saj", frames, inwards)
    wall = np.concatenate([radius[..., None], local], axis=-1)
    tables = Tables(
        points,
        frames,
        wall,
        np.float64(step),
        np.int32(0),
        np.int32(len(points)),
        axes=np.eye(3),
        device_radius=np.float64(device_radius),
    )
    if with_mesentery:
        width = np.interp(arcs, colon.centreline.arc, np.median(colon.radius, axis=1))
        tables = tables._replace(mesentery=mesentery.hang(points, arcs, width, colon.segments))
    narrow = arcs[(radius <= LEAST_RADIUS).mean(axis=1) > 0.5]
    return LumenTable(
        tables, device_radius, _error(surface, tables, arcs, radius, rays, device_radius, seed), tuple(narrow.tolist())
    )


def touch(xp: ModuleType, tables: Tables, points: Float[Any, "*worlds points 3"], arcs: Float[Any, "..."]) -> WallQuery:
    """Look points up that were near `arcs` at the last look.

    Args:
        xp: numpy or jax.numpy.
        tables: of one colon, or of one a world (`pick`).
        points: middles of the device's spheres [m].
        arcs: their arc lengths at the last look [m]; negative before the anus.
    """
    j, u = _cell(xp, tables, arcs)
    axis, tangent = _line_at(xp, tables, j, u)
    arcs = arcs + xp.clip(_dot(xp, points - axis, tangent), -WINDOW, WINDOW)
    j, u = _cell(xp, tables, arcs)
    axis, frame = _frame_at(xp, tables, j, u)
    offset = points - axis
    x, y = _dot(xp, offset, frame[..., 0]), _dot(xp, offset, frame[..., 1])
    radius = xp.sqrt(x * x + y * y + 1e-14)
    cos, sin = x / radius, y / radius
    count = tables.wall.shape[-2]
    turn = xp.arctan2(sin, cos) * (count / (2 * np.pi))
    k = xp.floor(turn)
    w = (turn - k)[..., None]
    k = k.astype(np.int32) % count
    after = (k + 1) % count
    u = xp.clip(u, 0.0, 1.0)[..., None]
    cells, j = tables.wall.reshape(-1, tables.wall.shape[-1]), j * count
    wall = (1 - u) * ((1 - w) * _rows(xp, cells, j + k) + w * _rows(xp, cells, j + after))
    j = j + count
    wall = wall + u * ((1 - w) * _rows(xp, cells, j + k) + w * _rows(xp, cells, j + after))
    normal = wall[..., 1:]
    normal = normal / xp.sqrt(_dot(xp, normal, normal))[..., None]
    slope = xp.maximum(-(normal[..., 0] * cos + normal[..., 1] * sin), LEAST_SLOPE)
    inwards = xp.einsum("...ij,...j->...i", frame, normal)
    depth = xp.where(arcs > 0, (radius - wall[..., 0]) * slope, -1.0)
    return WallQuery(arcs, depth, inwards)


def axis_at(xp: ModuleType, tables: Tables, arcs: Float[Any, "..."]) -> Float[Any, "..."]:
    """Points of the centreline at arc lengths [m]; the last one beyond its end."""
    j, u = _cell(xp, tables, arcs)
    u = xp.clip(u, 0.0, 1.0)[..., None]
    return (1 - u) * _rows(xp, tables.points, j) + u * _rows(xp, tables.points, j + 1)


def _cell(xp: ModuleType, tables: Tables, arcs: Any) -> tuple[Any, Any]:
    """Row of the station before an arc length, and the fraction of a step after it (beyond 0 and 1: outside)."""
    place = arcs / tables.step
    j = xp.clip(xp.floor(place), 0, tables.count - 2).astype(np.int32)
    return j + tables.first, place - j


def _rows(xp: ModuleType, array: Any, index: Any) -> Any:
    """Rows of an array; in numpy four times as fast as by square brackets."""
    return np.take(array, index, axis=0, mode="clip") if xp is np else array[index]


def _dot(xp: ModuleType, first: Any, second: Any) -> Any:
    """Products of vectors; several times as fast in numpy as a sum over an axis of three."""
    return xp.einsum("...i,...i->...", first, second)


def _line_at(xp: ModuleType, tables: Tables, j: Any, u: Any) -> tuple[Any, Any]:
    """The centreline, which goes on straight beyond its ends, and its tangent."""
    u = u[..., None]
    axis = (1 - u) * _rows(xp, tables.points, j) + u * _rows(xp, tables.points, j + 1)
    u = xp.clip(u, 0.0, 1.0)
    tangent = (1 - u) * _rows(xp, tables.frames, j)[..., 2] + u * _rows(xp, tables.frames, j + 1)[..., 2]
    return axis, tangent / xp.sqrt(_dot(xp, tangent, tangent))[..., None]


def _frame_at(xp: ModuleType, tables: Tables, j: Any, u: Any) -> tuple[Any, Any]:
    """The centreline, which goes on straight beyond its ends, and its frame."""
    u = u[..., None]
    axis = (1 - u) * _rows(xp, tables.points, j) + u * _rows(xp, tables.points, j + 1)
    u = xp.clip(u, 0.0, 1.0)[..., None]
    frame = (1 - u) * _rows(xp, tables.frames, j) + u * _rows(xp, tables.frames, j + 1)
    return axis, frame / xp.sqrt(xp.einsum("...ij,...ij->...j", frame, frame))[..., None, :]


def _stations(colon: Colon) -> tuple[np.ndarray, np.ndarray, float]:
    line = colon.centreline
    count = int(np.ceil(line.length / STATION_STEP)) + 1
    arcs = np.linspace(0.0, line.length, count)
    points = CubicSpline(line.arc, line.points)(arcs)
    frames = CubicSpline(line.arc, line.frames)(arcs)
    tangent = frames[:, :, 2] / np.linalg.norm(frames[:, :, 2], axis=1, keepdims=True)
    first = frames[:, :, 0] - tangent * np.einsum("si,si->s", frames[:, :, 0], tangent)[:, None]
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return points, np.stack([first, np.cross(tangent, first), tangent], axis=-1), float(arcs[1])


def _first_touch(
    surface: LumenDistance, points: np.ndarray, rays: np.ndarray, arcs: np.ndarray, device_radius: float
) -> Float[np.ndarray, "stations angles"]:
    """How far out along each ray a sphere first touches the wall; the least radius where it never fits."""
    stations, angles = rays.shape[:2]
    start, direction = np.repeat(points, angles, axis=0), rays.reshape(-1, 3)
    along = np.repeat(arcs, angles)

    def room(radius: np.ndarray, rows: np.ndarray) -> np.ndarray:
        found = surface.nearest(start[rows] + radius[:, None] * direction[rows], along[rows])
        return -found.outside - device_radius

    low, high = np.zeros(len(along)), np.full(len(along), np.nan)
    open_rays = np.arange(len(along))
    gap = room(low, open_rays)
    high[gap <= 0] = 0.0
    open_rays = open_rays[gap > 0]
    gap = gap[gap > 0]
    # Sphere tracing: a step as long as the room there is cannot pass a wall.
    for _ in range(_MARCH):
        low[open_rays] += gap
        gap = room(low[open_rays], open_rays)
        keep = gap > 1e-5
        high[open_rays[~keep]] = low[open_rays[~keep]]
        open_rays, gap = open_rays[keep], gap[keep]
        if not len(open_rays):
            break
    high[open_rays] = low[open_rays]
    return np.clip(high, LEAST_RADIUS, MOST_RADIUS).reshape(stations, angles)


def _error(surface, tables: Tables, arcs, radius, rays, device_radius: float, seed: int) -> TableAccuracy:
    """Compare with the surface at random places within 3 mm of touching."""
    random = np.random.default_rng(seed)
    s = random.integers(4, len(arcs) - 4, _PROBES)
    a = random.integers(0, ANGLES, _PROBES)
    fits = radius[s, a] > 2 * LEAST_RADIUS
    s, a = s[fits], a[fits]
    out = np.maximum(radius[s, a] + random.uniform(-0.003, 0.003, len(s)), 0.0)
    turn = 2 * np.pi * random.uniform(-0.5, 0.5, len(s)) / ANGLES
    side = np.cross(tables.frames[s, :, 2], rays[s, a])
    ray = np.cos(turn)[:, None] * rays[s, a] + np.sin(turn)[:, None] * side
    shift = random.uniform(-0.5, 0.5, (len(s), 1)) * float(tables.step)
    places = tables.points[s] + out[:, None] * ray + shift * tables.frames[s, :, 2]
    found = touch(np, tables, places, arcs[s])
    exact = surface.nearest(places, found.arcs)
    depth = exact.outside + device_radius
    near = np.abs(depth) < 0.003
    off = found.depth[near] - depth[near]
    cosine = np.clip(np.einsum("ij,ij->i", found.inwards[near], exact.inwards[near]), -1, 1)
    return TableAccuracy(
        depth_p50=float(np.median(np.abs(off))),
        depth_p95=float(np.percentile(np.abs(off), 95)),
        depth_mean=float(off.mean()),
        normal_p95_deg=float(np.degrees(np.percentile(np.arccos(cosine), 95))),
        probes=int(near.sum()),
    )
