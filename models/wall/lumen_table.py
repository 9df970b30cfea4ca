"""The wall as a table: how far from the centreline a device's middle may be, at every arc length and angle.

The lumen is shrunk by the device's radius, so that a sphere that touches the wall is a point on the shrunk surface.
That surface is tabulated over arc length and angle around the centreline, with its normal. Looking a point up takes a
few dozen operations and no search, has no seams, and is the same code in numpy and in JAX, where it is differentiable.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np
from jaxtyping import Float, Int
from scipy.interpolate import CubicSpline

from haustra.errors import UnsupportedSceneError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.store import colon_hash
from haustra.models.wall import mesentery, vectors
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.cache import cache_folder, keep, read
from haustra.models.wall.mesentery import Mesentery
from haustra.models.wall.signed_distance import LumenDistance
from haustra.models.wall.vectors import Vector, add, between, dot, minus, times, where
from haustra.provenance import content_hash

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
_ALONG = 2.0
"""Radii of more than this many times the median [1] are looks along the lumen, not across it."""
_FORMAT = 1
"""Version of the format of cached tables; those of another format are made anew."""
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
        return seen_from(self.tables, origin, axes)


def seen_from(own: Tables, origin: Float[np.ndarray, "3"], axes: Float[np.ndarray, "3 3"]) -> Tables:
    """Tables of one colon in coordinates that begin at `origin` [m], with the columns of `axes` as axes."""
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
    """One colon a world, for `query` with points of shape (worlds, points, 3); of the wall, nothing is copied."""
    moving = tables.mesentery and Mesentery(*(part[colons] for part in tables.mesentery))
    chosen = {name: getattr(tables, name)[colons][:, None] for name in ("step", "first", "count", "device_radius")}
    return tables._replace(**chosen, axes=tables.axes[colons], mesentery=moving)


def lumen_table(
    colon: Colon,
    *,
    device_radius: float,
    surface: Callable[[], LumenDistance] | None = None,
    with_mesentery: bool = False,
    abdomen: Abdomen | None = None,
) -> LumenTable:
    """Tabulate a colon's wall for spheres of one radius; what was tabulated before is read from the cache.

    Args:
        colon: the colon.
        device_radius: radius of the spheres [m].
        surface: gives the colon's exact surface, for callers who need several tables of it.
        with_mesentery: let the colon move on its mesentery; otherwise it is fixed in space.
        abdomen: what a colon that moves lies in; as it was imaged when None.
    """
    key = content_hash(colon_hash(colon).encode(), repr((_FORMAT, STATION_STEP, ANGLES, device_radius)).encode())
    path = cache_folder() / "tables" / f"{key}.npz"
    points, frames, step = _stations(colon)
    kept = _kept(path)
    if kept is None:
        kept = _tabulated(surface() if surface else LumenDistance(colon), points, frames, step, device_radius)
        buffer = BytesIO()
        np.savez(buffer, wall=kept["wall"], error=kept["error"], narrow=kept["narrow"])
        keep(path, buffer.getvalue())
    tables = _tables(points, frames, kept["wall"].astype(float), step, device_radius)
    if with_mesentery:
        tables = on_mesentery(tables, colon, abdomen)
    p50, p95, mean, normal, probes = kept["error"].tolist()
    error = TableAccuracy(p50, p95, mean, normal, int(probes))
    return LumenTable(tables, device_radius, error, tuple(kept["narrow"].tolist()))


def _kept(path: Path) -> dict[str, np.ndarray] | None:
    """What is kept there; None when nothing is, or not what it should be."""
    data = read(path)
    try:
        with np.load(BytesIO(data or b""), allow_pickle=False) as file:
            return {name: file[name] for name in ("wall", "error", "narrow")}
    except (OSError, EOFError, ValueError, KeyError, BadZipFile):
        return None


def _tabulated(
    surface: LumenDistance, points: np.ndarray, frames: np.ndarray, step: float, device_radius: float
) -> dict[str, np.ndarray]:
    """The wall in single precision, its error and where the device does not fit."""
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
    wall = np.concatenate([radius[..., None], local], axis=-1).astype(np.float32)
    tables = _tables(points, frames, wall.astype(float), step, device_radius)
    error = _error(surface, tables, arcs, radius, rays, device_radius)
    narrow = arcs[(radius <= LEAST_RADIUS).mean(axis=1) > 0.5]
    return {"wall": wall, "error": np.array(astuple(error)), "narrow": narrow}


def _tables(points: np.ndarray, frames: np.ndarray, wall: np.ndarray, step: float, device_radius: float) -> Tables:
    return Tables(
        points,
        frames,
        wall,
        np.float64(step),
        np.int32(0),
        np.int32(len(points)),
        axes=np.eye(3),
        device_radius=np.float64(device_radius),
    )


def put_distended(
    wall: Float[np.ndarray, "stations angles 4"],
    rest: Float[np.ndarray, "stations angles 4"],
    widths: Float[np.ndarray, " stations"],
    *,
    device_radius: float,
) -> None:
    """Write a wall that is wider or narrower than a tabulated one, as `Tables.wall`.

    A lumen that is narrower than the device gives way to it: nothing but tissue holds it closed.

    Args:
        wall: to write to.
        rest: the tabulated one.
        widths: of the lumen at each station, over those of the tabulated one [1].
        device_radius: that both are for [m].
    """
    share = widths[:, None]
    wall[..., 0] = distended_radius(np, rest[..., 0], share, device_radius)
    wall[..., 3] = rest[..., 3] * share


def distended_radius(xp: Any, radius: Any, width: Any, device_radius: Any) -> Any:
    """`put_distended` of one number: largest radius of the device's middle [m]; what has no room gets none."""
    wide = xp.minimum(xp.maximum((radius + device_radius) * width - device_radius, LEAST_RADIUS), MOST_RADIUS)
    return where(xp, radius > LEAST_RADIUS, wide, radius)


def table_between(first: Tables, last: Tables, device_radius: float) -> Tables:
    """A colon's table for spheres of a radius between those of two tables [m], by what is in proportion between them.

    Args:
        first: of a smaller radius.
        last: of a larger one, or `first`.
        device_radius: the radius wanted [m].
    """
    apart = float(last.device_radius - first.device_radius)
    share = (device_radius - float(first.device_radius)) / apart if apart else 0.0
    wall = (1 - share) * first.wall + share * last.wall
    return first._replace(wall=wall, device_radius=np.float64(device_radius if apart else first.device_radius))


def axis_tables(colon: Colon, abdomen: Abdomen | None = None) -> Tables:
    """Tables of a colon that moves, of its axis only: no wall is tabulated, to be looked up in."""
    points, frames, step = _stations(colon)
    return on_mesentery(_tables(points, frames, np.zeros((0, 1, 4)), step, 0.0), colon, abdomen)


def on_mesentery(
    tables: Tables, colon: Colon, abdomen: Abdomen | None = None, *, changed: Mapping[str, float] | None = None
) -> Tables:
    """Tables of a colon with its mesentery.

    Args:
        tables: of the colon, in its own coordinates.
        colon: the colon.
        abdomen: what it lies in; as it was imaged when None.
        changed: numbers to take instead of those of assets/numbers/mesentery.toml, by their names there.
    """
    arcs = tables.step * np.arange(len(tables.points))
    line, middle = colon.centreline.arc, np.median(colon.radius, axis=1)
    widest = np.minimum(colon.radius, _ALONG * middle[:, None]).max(axis=1)
    width, widest = np.interp(arcs, line, middle), np.interp(arcs, line, widest)
    hung = mesentery.hang(tables.points, arcs, width, colon.segments, widest=widest, abdomen=abdomen, changed=changed)
    return tables._replace(mesentery=hung)


def query(
    xp: Any, tables: Tables, points: Float[Any, "*worlds points 3"], arcs: Float[Any, "..."], most: Any = np.inf
) -> WallQuery:
    """Look points up that were near `arcs` at the last look.

    Args:
        xp: numpy or jax.numpy.
        tables: of one colon, or of one a world (`pick`).
        points: middles of the device's spheres [m].
        arcs: their arc lengths at the last look [m]; negative before the anus.
        most: arc length beyond which none is looked up [m].
    """
    own = tables.step, tables.first, tables.count
    arcs, depth, inwards = query_point(xp, tables, *own, vectors.of(points), arcs, most)
    return WallQuery(arcs, depth, vectors.stacked(xp, inwards))


def query_point(
    xp: Any, tables: Tables, step: Any, first: Any, count: Any, point: Vector, arc: Any, most: Any
) -> tuple[Any, Any, Vector]:
    """`query` of one point, or of arrays of them: arc length [m], depth [m] and inward normal.

    Args:
        xp: numpy or jax.numpy; numpy where numba compiles it.
        tables: whose points, frames and wall are read.
        step: distance between the colon's stations [m].
        first: its first station.
        count: its stations.
        point: middle of the sphere [m].
        arc: its arc length at the last look [m].
        most: arc length beyond which it is not looked up [m].
    """
    arc = xp.minimum(nearest_arc(xp, tables, step, first, count, point, arc), most)
    depth, inwards = wall_beside(xp, tables, step, first, count, point, arc)
    return arc, where(xp, arc > 0, depth, -1.0), inwards


def nearest_arc(xp: Any, tables: Tables, step: Any, first: Any, count: Any, point: Vector, arc: Any) -> Any:
    """Arc length of the centreline next to a point that was near `arc` at the last look [m]; as in `query_point`.

    Beyond the caecum's end there is none: who is pressed through the pole stands in the last cross-section.
    """
    frames = tables.frames
    j, u = _cell(xp, step, first, count, arc)
    beside = xp.minimum(xp.maximum(u, 0.0), 1.0)
    tangent = between(_column(frames, j, 2), _column(frames, j + 1, 2), beside)
    ahead = dot(minus(point, _line(tables, j, u)), tangent) / xp.sqrt(dot(tangent, tangent))
    return xp.minimum(arc + xp.minimum(xp.maximum(ahead, -WINDOW), WINDOW), step * (count - 1))


def wall_beside(
    xp: Any, tables: Tables, step: Any, first: Any, count: Any, point: Vector, arc: Any
) -> tuple[Any, Vector]:
    """Depth of a point in the wall [m], and the inward normal, at its arc length past the anus; as in `query_point`."""
    frames, wall = tables.frames, tables.wall
    j, u = _cell(xp, step, first, count, arc)
    offset = minus(point, _line(tables, j, u))
    u = xp.minimum(xp.maximum(u, 0.0), 1.0)
    across, side, along = (
        _unit(xp, between(_column(frames, j, 0), _column(frames, j + 1, 0), u)),
        _unit(xp, between(_column(frames, j, 1), _column(frames, j + 1, 1), u)),
        _unit(xp, between(_column(frames, j, 2), _column(frames, j + 1, 2), u)),
    )
    x, y = dot(offset, across), dot(offset, side)
    radius = xp.sqrt(x * x + y * y + 1e-14)
    cos, sin = x / radius, y / radius
    angles = wall.shape[1]
    turn = xp.arctan2(sin, cos) * (angles / (2 * np.pi))
    k = xp.floor(turn)
    w = turn - k
    k = xp.int32(k) % angles
    after = (k + 1) % angles
    edge = _mixed(wall, j, k, after, u, w, 0)
    normal = _mixed(wall, j, k, after, u, w, 1), _mixed(wall, j, k, after, u, w, 2), _mixed(wall, j, k, after, u, w, 3)
    normal = _unit(xp, normal)
    slope = xp.maximum(-(normal[0] * cos + normal[1] * sin), LEAST_SLOPE)
    inwards = add(add(times(normal[0], across), times(normal[1], side)), times(normal[2], along))
    return (radius - edge) * slope, inwards


def depth_bound(xp: Any, tables: Tables, step: Any, first: Any, count: Any, point: Vector, arc: Any) -> Any:
    """A bound of what `wall_beside` finds as depth [m], by the least radius of the lumen at the stations beside it.

    That stands behind their points (`least_radius`). The frames' axes are across each other to a hundredth between
    stations, by which a point may be further out along them.
    """
    j, u = _cell(xp, step, first, count, arc)
    offset = minus(point, _line(tables, j, u))
    outside = 1.01 * xp.sqrt(dot(offset, offset)) - xp.minimum(tables.points[j, 3], tables.points[j + 1, 3])
    return where(xp, outside < 0, LEAST_SLOPE * outside, outside)


def least_radius(wall: Float[np.ndarray, "stations angles 4"]) -> Float[np.ndarray, " stations"]:
    """Radius of the lumen where it is narrowest, at each station [m]."""
    return wall[..., 0].min(axis=1)


def axis_at(xp: Any, tables: Tables, arcs: Float[Any, "..."]) -> Float[Any, "..."]:
    """Points of the centreline at arc lengths [m]; the last one beyond its end."""
    return vectors.stacked(xp, axis_point(xp, tables, tables.step, tables.first, tables.count, arcs))


def axis_point(xp: Any, tables: Tables, step: Any, first: Any, count: Any, arc: Any) -> Vector:
    """`axis_at` one arc length, or arrays of them [m]; the colon's stations as in `query_point`."""
    j, u = _cell(xp, step, first, count, arc)
    return _line(tables, j, xp.minimum(xp.maximum(u, 0.0), 1.0))


def station_width(xp: Any, tables: Tables, step: Any, first: Any, count: Any, arc: Any) -> Any:
    """What stations hold behind their first axes, at an arc length [m]; the colon's stations as in `query_point`."""
    j, u = _cell(xp, step, first, count, arc)
    u = xp.minimum(xp.maximum(u, 0.0), 1.0)
    return (1 - u) * tables.frames[j, 3, 0] + u * tables.frames[j + 1, 3, 0]


def _cell(xp: Any, step: Any, first: Any, count: Any, arc: Any) -> tuple[Any, Any]:
    """Row of the station before an arc length, and the fraction of a step after it (beyond 0 and 1: outside)."""
    place = arc / step
    j = xp.int32(xp.floor(where(xp, place > 0, xp.minimum(place, count - 2), 0.0)))  # NaN: the first
    return j + first, place - j


def _line(tables: Tables, j: Any, u: Any) -> Vector:
    """The centreline, which goes on straight beyond its ends."""
    line = tables.points
    before, after = (line[j, 0], line[j, 1], line[j, 2]), (line[j + 1, 0], line[j + 1, 1], line[j + 1, 2])
    return between(before, after, u)


def _column(frames: Any, j: Any, axis: int) -> Vector:
    return frames[j, 0, axis], frames[j, 1, axis], frames[j, 2, axis]


def _mixed(wall: Any, j: Any, k: Any, after: Any, u: Any, w: Any, part: int) -> Any:
    """One number of the wall, between two stations and two angles."""
    here = (1 - w) * wall[j, k, part] + w * wall[j, after, part]
    return (1 - u) * here + u * ((1 - w) * wall[j + 1, k, part] + w * wall[j + 1, after, part])


def _unit(xp: Any, v: Vector) -> Vector:
    return times(1 / xp.sqrt(dot(v, v)), v)


PARTS = (_cell, _line, _column, _mixed, _unit, nearest_arc, wall_beside, query_point, axis_point)
"""What numba is to compile."""


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
    middles = open_rays[::angles]  # all rays of a station begin in its middle
    gap = np.repeat(room(low[middles], middles), angles)
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


def _error(surface, tables: Tables, arcs, radius, rays, device_radius: float) -> TableAccuracy:
    """Compare with the surface at random places within 3 mm of touching."""
    random = np.random.default_rng(0)
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
    found = query(np, tables, places, arcs[s])
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
