"""What a camera in the lumen sees: one interface of all renderers, and the one that needs no OpenGL.

    renderer = RayRenderer(colon, named_lens("cf-hq190l").at(480, 480))
    renderer.place(vertices)                      # where the colon's vertices are now [m], when it has moved
    view = renderer.look(CameraPose(position, rotation))
    view.distance, view.depth                     # along rays, and along the axis [m]; infinite where nothing is
    view.normals, view.triangle, view.weights     # in the camera's axes; -1; barycentric coordinates
    view.points()                                 # places in the world [m]
    view.interpolate(values)                      # anything known at the vertices: rest places for flow, arcs, seen

`look` costs some 10 ms on two cores for 480 x 480 pixels and 600,000 triangles. `renderer.lens.grid` holds the rays of
all pixels in the camera's axes (MuJoCo's: right, up, backwards), `renderer.lens.within` which of them are not black.
"""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.view.picture.lens import Lens
from haustra.models.anatomy.colon import Surface

_BANDS = 8
"""Parts of a picture and of a surface that threads take one by one."""
_RADII = 2048
"""Places of the table of a lens's radii."""
_MOST = 3.0
"""tan(angle / 2) at which that table ends: 143 degrees off the axis."""


@dataclass(frozen=True)
class CameraPose:
    """Where a camera is and how it is turned."""

    position: Float[np.ndarray, "3"]
    """Optical centre [m]."""
    rotation: Float[np.ndarray, "3 3"]
    """Columns are the camera's right, up and backward directions in the world (MuJoCo's: it looks along -z)."""


@dataclass(frozen=True)
class SurfaceView:
    """What the rays of a picture meet, with all that is known there exactly."""

    pose: CameraPose
    """Where the camera was."""
    lens: Lens
    """Whose pixels these are."""
    faces: Int[np.ndarray, "triangles 3"]
    """Corners of the surface's triangles."""
    vertices: Float[np.ndarray, "vertices 3"]
    """Where the vertices were [m]."""
    distance: Float[np.ndarray, "height width"]
    """Along each pixel's ray [m]; infinite where it meets nothing."""
    triangle: Int[np.ndarray, "height width"]
    """Which triangle it meets; -1 for none."""
    weights: Float[np.ndarray, "height width 3"]
    """Barycentric coordinates there; zero for none."""
    normals: Float[np.ndarray, "height width 3"]
    """Unit normals in the camera's axes, into the lumen, smooth from triangle to triangle; zero for none."""

    @property
    def depth(self) -> Float[np.ndarray, "height width"]:
        """Distance along the camera's axis [m], as C3VD has it; infinite where a ray meets nothing."""
        with np.errstate(invalid="ignore"):
            along = -self.lens.grid[..., 2] * self.distance
        return np.where(self.triangle >= 0, along, np.inf)

    def points(self) -> Float[np.ndarray, "height width 3"]:
        """Where in the world each ray meets the surface [m]; NaN where it meets nothing."""
        away = np.where(self.triangle >= 0, self.distance, np.nan)[..., None] * self.lens.grid
        return self.pose.position + away @ self.pose.rotation.T

    def interpolate(self, values: Float[np.ndarray, "vertices ..."]) -> Float[np.ndarray, "height width ..."]:
        """Values of the vertices where rays meet the surface; NaN where they meet nothing."""
        corners = values[self.faces[self.triangle]]
        found = np.einsum("hwk,hwk...->hw...", self.weights, corners)
        found[self.triangle < 0] = np.nan
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

    def __init__(self, surface: Surface, lens: Lens, *, threads: int | None = None) -> None:
        """Take a surface, and a lens at the size of the pictures; as many threads as there are cores when None."""
        self.lens = lens
        self._surface = surface
        self._faces = np.ascontiguousarray(surface.faces, np.int32)
        self._vertices = np.ascontiguousarray(surface.vertices, float)
        count, triangles = len(surface.vertices), len(surface.faces)
        self._local, self._image = np.empty((count, 3)), np.empty((count, 3))
        self._boxes, self._kept = np.empty((triangles, 4), np.int32), np.empty(triangles, np.int32)
        order = np.argsort(self._faces, axis=None, kind="stable")
        self._around = (order // 3).astype(np.int32)
        self._starts = np.searchsorted(self._faces.ravel()[order], np.arange(count + 1)).astype(np.int32)
        self._stamps, self._now, self._normals = np.zeros(count, np.int32), 0, np.empty((count, 3), np.float32)
        self._rays = np.ascontiguousarray(lens.grid, np.float32)
        self._rays[~lens.within] = np.nan
        self._placement = np.array([*lens.centre, *np.ravel(lens.stretch)])
        self._radii = _radii(lens)
        self._threads = threads or len(os.sched_getaffinity(0))
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None

    def place(self, vertices: Float[np.ndarray, "vertices 3"]) -> None:
        """Take the surface to where its vertices are now [m]; the array is kept, not copied, where it can be."""
        self._vertices = np.ascontiguousarray(vertices, float)

    def look(self, pose: CameraPose) -> SurfaceView:
        """As `Renderer.look`."""
        from haustra.envs.view.picture import kernels

        self._now += 1
        height, width = self._rays.shape[:2]
        eye, axes = np.ascontiguousarray(pose.position, float), np.ascontiguousarray(pose.rotation, float)
        distance, triangle = np.full((height, width), np.inf, np.float32), np.full((height, width), -1, np.int32)
        weights, normals = np.zeros((height, width, 3), np.float32), np.zeros((height, width, 3), np.float32)
        lens = self._placement, self._radii, _MOST
        widest = np.tan(np.radians(min(self.lens.field_of_view_deg, 250.0)) / 4)

        def see(first: int, last: int) -> None:
            kernels.see_vertices(self._vertices, first, last, eye, axes, *lens, self._local, self._image)

        def box(first: int, last: int) -> tuple[int, int]:
            found = self._faces, first, last, self._local, self._image, *lens, widest, width, height
            return first, kernels.find_boxes(*found, self._boxes, self._kept)

        self._each(see, len(self._vertices))
        boxes = self._each(box, len(self._faces))

        def cast(first: int, last: int) -> None:
            for start, end in boxes:
                seen = self._faces, self._local, self._boxes, self._kept, start, end
                kernels.cast(first, last, *seen, self._rays, distance, triangle)
            about = self._starts, self._around, self._stamps, self._now, self._normals
            seen = self._faces, self._local, self._rays, triangle
            kernels.resolve(first, last, *seen, *about, weights, normals)

        self._each(cast, height)
        return SurfaceView(pose, self.lens, self._surface.faces, self._vertices, distance, triangle, weights, normals)

    def _each(self, work: Callable[[int, int], object], count: int) -> list:
        """Do work on all parts of a range, beside each other."""
        ends = np.linspace(0, count, (_BANDS if self._pool else 1) + 1).astype(int)
        parts = zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)
        if self._pool is None:
            return [work(*part) for part in parts]
        return list(self._pool.map(lambda part: work(*part), parts))


def _radii(lens: Lens) -> Float[np.ndarray, " places"]:
    """The lens's radius for tan(angle / 2) from 0 to `_MOST`; beyond what the lens sees it goes on in line."""
    half = np.linspace(0.0, _MOST, _RADII)
    radius = lens.radius(np, 2 * np.arctan(half))
    good = int(np.isfinite(radius).sum())
    slope = (radius[good - 1] - radius[good - 2]) if good < _RADII else 0.0
    radius[good:] = radius[good - 1] + max(slope, 0.0) * np.arange(1, _RADII - good + 1)
    return radius
