"""What a camera in the lumen sees: one interface of all renderers, and the one that needs no OpenGL.

    renderer = RayRenderer(colon, named_lens("cf-hq190l").at(480, 480))
    renderer.place(vertices)                      # where the colon's vertices are now [m], when it has moved
    view = renderer.look(CameraPose(position, rotation))
    view.distance, view.depth                     # along rays, and along the axis [m]; infinite where nothing is
    view.normals, view.triangle, view.weights     # in the camera's axes; -1; barycentric coordinates
    view.points()                                 # places in the world [m]
    view.interpolate(values)                      # anything known at the vertices: rest places for flow, arcs, seen

`look` takes some 17 ms of processor time for 480 x 480 pixels and 600,000 triangles. `renderer.lens.grid` holds the
rays of all pixels in the camera's axes (MuJoCo's: right, up, backwards), `renderer.lens.within` which are not black.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.view.picture import caster
from haustra.envs.view.picture.lens import Lens
from haustra.envs.view.picture.surface import LumenSurface
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Surface

_ROWS = 32
"""Rows of a picture that a thread takes at a time."""
_TILE = 16
"""Rows and columns of a part of a picture that may hide what is behind it [pixels]."""
_NEAR = 0.05
"""What is nearer than this is drawn first, and may hide the rest [m]."""
_RADII = 2048
"""Places of the table of a lens's radii."""
MOST = 3.0
"""tan(angle / 2) at which the table of a lens's radii ends: 143 degrees off the axis."""


@dataclass(frozen=True)
class CameraPose:
    """Where a camera is and how it is turned."""

    position: Float[np.ndarray, "3"]
    """Optical centre [m]."""
    rotation: Float[np.ndarray, "3 3"]
    """Columns are the camera's right, up and backward directions in the world (MuJoCo's: it looks along -z)."""

    def __post_init__(self) -> None:
        if np.linalg.det(self.rotation) < 0.5:
            raise InvalidOptionError("A camera's right, up and backward directions must be right-handed unit vectors.")

    @classmethod
    def of_tip(cls, position: Float[np.ndarray, "3"], frame: Float[np.ndarray, "3 3"]) -> "CameraPose":
        """The camera at a tip, wire 'up' up, given the tip's frame: wire 'up', wire 'left' and ahead as columns.

        These three are right-handed, so that wire 'left' is on the right of what the camera sees.
        """
        return cls(np.asarray(position, float), np.column_stack([frame[:, 1], frame[:, 0], -frame[:, 2]]).astype(float))

    def towards(self, other: "CameraPose", share: float) -> "CameraPose":
        """The pose that share of a short way from here to another."""
        turned, _ = np.linalg.qr(self.rotation + share * (other.rotation - self.rotation))
        turned = turned * np.sign(np.einsum("ij,ij->j", turned, other.rotation))
        return CameraPose(self.position + share * (other.position - self.position), turned)


@dataclass(frozen=True)
class SurfaceView:
    """What the rays of a picture meet, with all that is known there exactly."""

    pose: CameraPose
    """Where the camera was."""
    lens: Lens
    """Whose pixels these are."""
    surface: LumenSurface
    """What they look at. It may have moved on since."""
    vertices: Float[np.ndarray, "vertices 3"]
    """Where the vertices of the surface as it was given were then [m]."""
    own: Int[np.ndarray, "height width"]
    """Which of `surface.faces` each pixel's ray meets; -1 for none."""
    planes: Float[np.ndarray, "7 height width"]
    """`distance`, `weights` and `normals`, plane after plane."""

    @property
    def distance(self) -> Float[np.ndarray, "height width"]:
        """Along each pixel's ray [m]; infinite where it meets nothing."""
        return self.planes[0]

    @property
    def weights(self) -> Float[np.ndarray, "height width 3"]:
        """Barycentric coordinates there; zero for none."""
        return np.moveaxis(self.planes[1:4], 0, -1)

    @property
    def normals(self) -> Float[np.ndarray, "height width 3"]:
        """Unit normals in the camera's axes, into the lumen, smooth from triangle to triangle; zero for none."""
        return np.moveaxis(self.planes[4:7], 0, -1)

    @property
    def faces(self) -> Int[np.ndarray, "triangles 3"]:
        """Corners of the triangles of the surface as it was given."""
        return self.surface.given.faces

    @property
    def triangle(self) -> Int[np.ndarray, "height width"]:
        """Which triangle of the surface as it was given each ray meets; -1 for none."""
        return np.where(self.own >= 0, self.surface.face_order[self.own], -1)

    @property
    def depth(self) -> Float[np.ndarray, "height width"]:
        """Distance along the camera's axis [m], as C3VD has it; infinite where a ray meets nothing."""
        with np.errstate(invalid="ignore"):
            along = -self.lens.grid[..., 2] * self.distance
        return np.where(self.own >= 0, along, np.inf)

    def points(self) -> Float[np.ndarray, "height width 3"]:
        """Where in the world each ray meets the surface [m]; NaN where it meets nothing."""
        away = np.where(self.own >= 0, self.distance, np.nan)[..., None] * self.lens.grid
        return self.pose.position + away @ self.pose.rotation.T

    def interpolate(self, values: Float[np.ndarray, "vertices ..."]) -> Float[np.ndarray, "height width ..."]:
        """Values of the given surface's vertices where rays meet it; NaN where they meet nothing."""
        corners = values[self.surface.order][self.surface.faces[self.own]]
        found = np.einsum("hwk,hwk...->hw...", self.weights, corners)
        found[self.own < 0] = np.nan
        return found


class Renderer(ABC):
    """Draws one surface, seen from inside, through one lens."""

    lens: Lens
    """At the size of the pictures."""

    @abstractmethod
    def place(self, vertices: Float[np.ndarray, "vertices 3"]) -> None:
        """Take the surface to where its vertices are now [m]."""

    @abstractmethod
    def look(self, pose: CameraPose) -> SurfaceView:
        """What the rays of all pixels meet. Triangles are seen from inside the surface only."""


class RayRenderer(Renderer):
    """Exact rays on the CPU, without OpenGL, for surfaces that move (`haustra.envs.view.picture.kernels`)."""

    def __init__(self, surface: LumenSurface | Surface, lens: Lens, *, threads: int | None = None) -> None:
        """Take a surface, and a lens at the size of the pictures; as many threads as there are cores when None.

        Raises:
            InvalidOptionError: when a row of the picture is narrower than what is worked out at a time.
        """
        if min(lens.width, lens.height) < caster.LANES:
            raise InvalidOptionError(f"A picture has at least {caster.LANES} rows and columns.")
        self.lens = lens
        self.surface = surface if isinstance(surface, LumenSurface) else LumenSurface(surface)
        """Where the surface is."""
        count, triangles = len(self.surface.vertices), len(self.surface.faces)
        self._local, self._image = np.empty((count, 3)), np.empty((count, 3))
        self._boxes, self._kept = np.empty((triangles, 4), np.int32), np.empty(triangles, np.int32)
        self._planes = np.empty((triangles, caster.PLANES), np.float32)
        self._starts, self._around = triangles_around(self.surface)
        self._stamps, self._now, self._normals = np.zeros(count, np.int32), 0, np.empty((count, 3), np.float32)
        self._rays = np.ascontiguousarray(np.moveaxis(lens.grid, -1, 0), np.float32)
        self._rays[:, ~lens.within] = np.nan
        self._tiles = _Tiles(lens)
        self._placement = np.array([*lens.centre, *np.ravel(lens.stretch)])
        self._radii = radii(lens)
        self._threads = threads or len(os.sched_getaffinity(0))
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None

    def place(self, vertices: Float[np.ndarray, "vertices 3"]) -> None:
        """As `Renderer.place`."""
        self.surface.place(vertices)

    def look(self, pose: CameraPose) -> SurfaceView:
        """As `Renderer.look`."""
        from haustra.envs.view.picture import kernels

        self._now += 1
        surface, height, width = self.surface, self.lens.height, self.lens.width
        eye, axes = np.ascontiguousarray(pose.position, float), np.ascontiguousarray(pose.rotation, float)
        planes, triangle = np.zeros((7, height, width), np.float32), np.full((height, width), -1, np.int32)
        distance = planes[0]
        distance[:] = np.inf
        lens = self._placement, self._radii, MOST
        widest = np.tan(np.radians(min(self.lens.field_of_view_deg, 250.0)) / 4)

        def see(stretch: int) -> None:
            surface.bring(stretch)
            first, last = int(surface.ends[stretch]), int(surface.ends[stretch + 1])
            kernels.see_vertices(surface.vertices, first, last, eye, axes, *lens, self._local, self._image)

        def box(stretch: int) -> tuple[int, int]:
            first, last = int(surface.face_ends[stretch]), int(surface.face_ends[stretch + 1])
            found = surface.faces, first, last, self._local, self._image, *lens, widest, width, height
            return first, kernels.find_boxes(*found, self._boxes, self._planes, self._kept)

        middles, reaches = surface.balls()
        middles = (middles - eye) @ axes
        away = np.linalg.norm(middles, axis=1)
        seen = np.flatnonzero(self._tiles.meets(middles, reaches))
        near = away[seen] - reaches[seen] < _NEAR
        brought = np.zeros(0, int)
        for stretches in (seen[near], seen[~near]):
            if len(brought):
                stretches = stretches[self._tiles.meets(middles[stretches], reaches[stretches], distance)]
            if not len(stretches):
                continue
            needed = np.setdiff1d(surface.needed(stretches), brought)
            self._each(see, needed.tolist())
            brought = np.union1d(brought, needed)
            ranges = np.array(self._each(box, stretches.tolist()), np.int32).reshape(-1, 2)
            self.each_row(caster.bind(self._boxes, self._planes, ranges, self._rays, distance, triangle))
        met = surface.faces, self._local, self._rays, self._planes, self._kept
        around = self._starts, self._around, self._stamps, self._now, self._normals
        self.each_row(lambda first, last: kernels.resolve(first, last, *met, *around, triangle, planes[1:]))
        return SurfaceView(pose, self.lens, surface, surface.given_vertices, triangle, planes)

    def each_block(self, size: int, work: Callable[[int, int], Any]) -> None:
        """Do work on all blocks of so many pixels, some at a time, from a first one to before a last one."""
        count = -(-self.lens.height * self.lens.width // size)
        some = max(_ROWS * self.lens.width // size, 1)
        self._each(lambda first: work(first, min(first + some, count)), range(0, count, some))

    def each_row(self, work: Callable[[int, int], Any]) -> None:
        """Do work on all rows of a picture, some at a time, from a first one to before a last one."""
        height = self.lens.height
        self._each(lambda row: work(row, min(row + _ROWS, height)), range(0, height, _ROWS))

    def _each(self, work: Callable[[int], Any], parts: Sequence[int]) -> list:
        """Do work on all parts, beside each other."""
        return list(map(work, parts) if self._pool is None else self._pool.map(work, parts))


class _Tiles:
    """Parts of a picture, each with a cone around its rays, by which whole stretches of a surface are left out."""

    def __init__(self, lens: Lens) -> None:
        rays = np.where(lens.within[..., None], lens.grid, 0.0)
        self._rows, self._columns = (np.arange(0, size, _TILE) for size in (lens.height, lens.width))
        total = self._folded(np.add, rays)
        self._used = (total**2).sum(axis=-1) > 0
        self._axes = total[self._used] / np.linalg.norm(total[self._used], axis=-1, keepdims=True)
        row, column = (np.arange(size) // _TILE for size in (lens.height, lens.width))
        spread = np.full((len(self._rows), len(self._columns), 3), 0.0)
        spread[self._used] = self._axes
        cosine = np.where(lens.within, (spread[row[:, None], column[None]] * rays).sum(axis=-1), 1.0)
        self._angles = np.arccos(np.clip(self._folded(np.minimum, cosine)[self._used], -1, 1))
        self._within = lens.within

    def meets(
        self,
        middles: Float[np.ndarray, "balls 3"],
        radii: Float[np.ndarray, " balls"],
        distance: Float[np.ndarray, "height width"] | None = None,
    ) -> np.ndarray:
        """Which balls in the camera's axes [m] some ray may meet before those distances [m]."""
        away = np.linalg.norm(middles, axis=1)
        wide = np.arcsin(np.minimum(radii / np.maximum(away, 1e-9), 1.0))
        wide[away <= radii] = np.pi
        off = np.arccos(np.clip(middles @ self._axes.T / np.maximum(away, 1e-9)[:, None], -1, 1))
        met = off <= wide[:, None] + self._angles
        if distance is not None:
            farthest = self._folded(np.maximum, np.where(self._within, distance, 0.0))[self._used]
            met &= farthest > (away - radii)[:, None]
        return met.any(axis=1)

    def _folded(self, fold: np.ufunc, values: np.ndarray) -> np.ndarray:
        return fold.reduceat(fold.reduceat(values, self._rows, axis=0), self._columns, axis=1)


def triangles_around(surface: LumenSurface) -> tuple[Int[np.ndarray, " starts"], Int[np.ndarray, " corners"]]:
    """Which triangles are around each vertex of a surface: where those of each begin, and the end; and they."""
    order = np.argsort(surface.faces, axis=None, kind="stable")
    count = len(surface.vertices)
    starts = np.searchsorted(surface.faces.ravel()[order], np.arange(count + 1)).astype(np.int32)
    return starts, (order // 3).astype(np.int32)


def radii(lens: Lens) -> Float[np.ndarray, " places"]:
    """The lens's radius for tan(angle / 2) from 0 to `MOST`; beyond what the lens sees it goes on in line."""
    half = np.linspace(0.0, MOST, _RADII)
    radius = lens.radius(np, 2 * np.arctan(half))
    good = int(np.isfinite(radius).sum())
    slope = (radius[good - 1] - radius[good - 2]) if good < _RADII else 0.0
    radius[good:] = radius[good - 1] + max(slope, 0.0) * np.arange(1, _RADII - good + 1)
    return radius
