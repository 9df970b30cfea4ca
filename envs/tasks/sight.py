"""What a camera at the tip could measure of the lumen: distances along rays, and which of the wall has been seen.

The lumen is taken as its distance from the centreline at each arc length and angle, so a fold hides what is behind it,
but nothing is seen round the corner of an overhang. Light, mucus and motion blur are left out.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from haustra.envs.sim.backend import AbstractBackend
from haustra.envs.tasks.case import TabulatedColon
from haustra.envs.view.picture.lens import lens_rays
from haustra.envs.view.picture.lumen_rays import Line, around, crossing
from haustra.models.wall import vectors
from haustra.models.wall.lumen_table import pick, stack
from haustra.models.wall.moving_colon import back_to_reference
from haustra.models.wall.vectors import Vector, add, times

RANGE = 0.12
"""Farthest distance that is measured [m]: the lamps show little beyond; engineering choice."""
RINGS_DEG = (20.0, 40.0, 60.0)
"""Angles of the rays from the viewing direction [degrees], within a camera's 140 degrees."""
RAYS = 8
"""Rays on each ring; one more goes straight ahead."""
STEPS = RANGE * (np.arange(1, 25) / 24) ** 1.5
"""Places along a ray where the wall is looked for: 1 mm apart near the tip, 7 mm apart far off [m]."""
DEPTH_STEPS = RANGE * (np.arange(1, 41) / 40) ** 1.3
"""Places along a ray where the wall is looked for when a whole depth picture is taken [m]."""


@cache
def ray_directions() -> Float[np.ndarray, "rays 3"]:
    """Unit vectors in the tip's frame: straight ahead, then ring by ring from wire 'up' towards wire 'left'."""
    turn = 2 * np.pi * np.arange(RAYS) / RAYS
    rays = [np.array([[0.0, 0.0, 1.0]])]
    for ring in RINGS_DEG:
        aside, ahead = math.sin(math.radians(ring)), math.cos(math.radians(ring))
        rays.append(np.column_stack([aside * np.cos(turn), aside * np.sin(turn), np.full(RAYS, ahead)]))
    return np.vstack(rays)


class Lumens(NamedTuple):
    """The arrays of all colons, one after the other, in single precision: exact to a micrometre here."""

    points: Any
    """(stations, 3): the centrelines [m]."""
    frames: Any
    """(stations, 3, 3): columns are first normal, second normal, tangent."""
    sight: Any
    """(stations, angles): distance from the centreline to the lumen surface [m]."""
    first: Any
    """(colons,): index of a colon's first station."""
    count: Any
    """(colons,): its stations."""
    step: Any
    """(colons,): distance between its stations [m]."""

    def stations(self, case: Any) -> "Stations":
        """Those of each world's colon, with an axis for rays."""
        count = self.count[case][:, None].astype(np.float32)
        return Stations(self.step[case][:, None], self.first[case][:, None], count)


class Stations(NamedTuple):
    """Where in the tables each world's colon is."""

    step: Any
    """Distance between its stations [m]."""
    first: Any
    """Index of the first."""
    count: Any
    """How many there are: a real number."""


class Sight:
    """Rays into some colons."""

    def __init__(self, cases: Sequence[TabulatedColon]) -> None:
        """Keep the tables."""
        tables = stack([case.tables for case in cases])
        self.lumens = Lumens(
            points=tables.points.astype(np.float32),
            frames=tables.frames.astype(np.float32),
            sight=np.concatenate([case.sight for case in cases]).astype(np.float32),
            first=tables.first,
            count=tables.count,
            step=tables.step.astype(np.float32),
        )

    def tip_distances(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        frame: Float[np.ndarray, "worlds 3 3"],
        arc: Float[np.ndarray, " worlds"],
        at_rest: Callable[[Any, Any], Any] | None = None,
    ) -> Float[np.ndarray, "worlds rays"]:
        """Distance to the wall along the rays of `ray_directions` [m], for tips with these frames."""
        return self.distances(case, eye, np.einsum("wij,rj->wri", frame, ray_directions()), arc, at_rest=at_rest)

    def distances(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        directions: Float[np.ndarray, "worlds rays 3"],
        arc: Float[np.ndarray, " worlds"],
        steps: Float[np.ndarray, " steps"] | None = None,
        at_rest: Callable[[Any, Any], Any] | None = None,
    ) -> Float[np.ndarray, "worlds rays"]:
        """Distance to the wall along rays [m], at most the last of `steps`.

        Args:
            case: which colon each world is in.
            eye: where the rays begin [m].
            directions: unit vectors.
            arc: arc length of the eye [m].
            steps: distances at which the wall is looked for [m].
            at_rest: takes points near arc lengths to where they would be, had the colon not moved.
        """
        steps = (STEPS if steps is None else steps).astype(np.float32)
        eye, directions = eye.astype(np.float32), directions.astype(np.float32)
        now = begin_march(np, arc, directions.shape[1], float(steps[-1]))
        stations, eyes, rays = self.lumens.stations(case), vectors.of(eye[:, None]), vectors.of(directions)
        for distance in steps:
            now = march(np, self.lumens, stations, eyes, rays, now, distance, of_vectors(np, at_rest))
            if not now.open.any():
                break
        return now.found.astype(float)

    def depth(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        frame: Float[np.ndarray, "worlds 3 3"],
        arc: Float[np.ndarray, " worlds"],
        *,
        field_of_view_deg: float,
        size: int,
        at_rest: Callable[[Any, Any], Any] | None = None,
    ) -> Float[np.ndarray, "worlds size size"]:
        """Distance to the wall in each pixel of a fisheye picture [m]; zero outside the lens's circle.

        Colons that have moved are drawn with `at_rest`, as `distances` takes it.
        """
        rays, within = lens_rays(field_of_view_deg, size)
        directions = rays.reshape(-1, 3) @ frame.swapaxes(-1, -2)
        found = self.distances(case, eye, directions, arc, DEPTH_STEPS, at_rest)
        return np.where(within, found.reshape(-1, size, size), 0.0)

    def inside(
        self,
        case: Int[np.ndarray, " worlds"],
        points: Float[np.ndarray, "worlds points 3"],
        arcs: Float[np.ndarray, "worlds points"],
    ) -> Bool[np.ndarray, "worlds points"]:
        """Whether points near those arc lengths [m] lie in the lumen."""
        places = vectors.of(points.astype(np.float32))
        return room(np, self.lumens, self.lumens.stations(case), places, arcs.astype(np.float32))[1] > 0

    def beyond(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        arc: Float[np.ndarray, " worlds"],
    ) -> Float[np.ndarray, "worlds 3"]:
        """Unit vectors outwards, away from the centreline, of eyes that are beyond the wall; zero in the lumen."""
        lumens, places = self.lumens, vectors.of(eye.astype(np.float32)[:, None])
        arcs, left = room(np, lumens, lumens.stations(case), places, arc.astype(np.float32)[:, None])
        station = np.clip(np.rint(arcs[:, 0] / lumens.step[case]), 0, lumens.count[case] - 1).astype(int)
        away = eye - lumens.points[lumens.first[case] + station]
        length = np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
        return np.where(left > 0, 0.0, away / length)

    def surface(
        self, case: int, rows: Int[np.ndarray, " cells"], columns: Int[np.ndarray, " cells"]
    ) -> Float[np.ndarray, "cells 3"]:
        """Places of the wall at stations and angles of one colon [m]."""
        points, frames, sight = self.lumens[:3]
        row = self.lumens.first[case] + rows
        turn = 2 * np.pi * columns / sight.shape[1]
        across = frames[row, :, 0] * np.cos(turn)[:, None] + frames[row, :, 1] * np.sin(turn)[:, None]
        return (points[row] + sight[row, columns][:, None] * across).astype(float)


class Eyes(ABC):
    """Looks from the tips of all worlds into their colons, where these are now."""

    @abstractmethod
    def tip_distances(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        frame: Float[np.ndarray, "worlds 3 3"],
        arc: Float[np.ndarray, " worlds"],
    ) -> Float[np.ndarray, "worlds rays"]:
        """Distance to the wall along the rays of `ray_directions` [m], for tips with these frames."""

    @abstractmethod
    def depth(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        frame: Float[np.ndarray, "worlds 3 3"],
        arc: Float[np.ndarray, " worlds"],
        *,
        field_of_view_deg: float,
        size: int,
    ) -> UInt8[np.ndarray, "worlds size size"]:
        """Distance to the wall in each pixel, 255 for `RANGE` and beyond; zero outside the lens's circle."""


class HostEyes(Eyes):
    """Rays that numpy follows."""

    def __init__(self, sight: Sight, backend: AbstractBackend) -> None:
        """The backend knows where colons that move are."""
        self._sight, self._backend = sight, backend

    def tip_distances(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        frame: Float[np.ndarray, "worlds 3 3"],
        arc: Float[np.ndarray, " worlds"],
    ) -> Float[np.ndarray, "worlds rays"]:
        """As `Eyes.tip_distances`."""
        return self._sight.tip_distances(case, eye, frame, arc, self.at_rest(case))

    def depth(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        frame: Float[np.ndarray, "worlds 3 3"],
        arc: Float[np.ndarray, " worlds"],
        *,
        field_of_view_deg: float,
        size: int,
    ) -> UInt8[np.ndarray, "worlds size size"]:
        """As `Eyes.depth`."""
        lens = {"field_of_view_deg": field_of_view_deg, "size": size}
        return in_bytes(self._sight.depth(case, eye, frame, arc, **lens, at_rest=self.at_rest(case)))

    def at_rest(self, case: Int[np.ndarray, " worlds"]) -> Callable[[Any, Any], Any] | None:
        """As `Sight.distances` takes it; None where colons are fixed."""
        displacement = self._backend.displacement
        return None if displacement is None else back_to_reference(np, pick(self._backend.tables, case), displacement)


def in_bytes(depth: Float[np.ndarray, "*pixels"]) -> UInt8[np.ndarray, "*pixels"]:
    """Depth [m] over `RANGE`, as a picture has it."""
    return np.rint(255 * depth / RANGE).astype(np.uint8)


class March(NamedTuple):
    """Rays on their way; shapes (worlds, rays)."""

    arcs: Any
    """Arc length where each ray is [m]."""
    room: Any
    """Distance from there to the wall along the radius [m]."""
    distance: Any
    """How far they have come [m]: one number."""
    found: Any
    """Distance to the wall [m]; the farthest that is looked at where there was none yet."""
    open: Any
    """Whether a ray is still in the lumen."""


FIRST_ROOM, LEAST_ROOM = 1e-3, 1e-6
"""Distance from an eye to the wall before it was looked for, and the least that counts where it is on the way [m]."""


def begin_march(xp: ModuleType, arc: Float[Any, " worlds"], rays: int, farthest: Any) -> March:
    """Rays at their eyes, at arc length `arc` [m].

    Args:
        xp: numpy or jax.numpy.
        arc: of each eye [m].
        rays: from each eye.
        farthest: distance that stands for no wall [m]; a number, or what JAX traces.
    """
    shape = (arc.shape[0], rays)
    return March(
        arcs=xp.broadcast_to(arc[:, None], shape).astype(np.float32),
        room=xp.full(shape, FIRST_ROOM, np.float32),
        distance=xp.zeros((), np.float32),
        found=xp.full(shape, farthest, np.float32),
        open=xp.ones(shape, bool),
    )


AtRest: TypeAlias = Callable[[Vector, Any], Vector]
"""From places near arc lengths to where they would be, had the colon not moved."""


def of_vectors(xp: ModuleType, at_rest: Callable[[Any, Any], Any] | None) -> AtRest | None:
    """What takes vectors, given what takes arrays with an axis of components; None of a colon that does not move."""
    return at_rest and (lambda place, arcs: vectors.of(at_rest(vectors.stacked(xp, place), arcs)))


def march(
    xp: Any,
    lumens: Any,
    stations: Stations,
    eye: Vector,
    direction: Vector,
    now: March,
    distance: Any,
    at_rest: AtRest | None = None,
) -> March:
    """Take all rays on to one more distance from their eyes.

    Args:
        xp: numpy, jax.numpy, or what writes programs.
        lumens: the colons: `points`, `frames` and `sight` of stations are read.
        stations: of each world's colon.
        eye: where the rays begin [m].
        direction: unit vectors.
        now: how far they are.
        distance: where to look next [m].
        at_rest: of colons that move.
    """
    place = add(eye, times(distance, direction))
    arcs, left = room(xp, lumens, stations, at_rest(place, now.arcs) if at_rest else place, now.arcs)
    hit = now.open & (left <= 0)
    found = xp.where(hit, crossing(xp, now.distance, now.room, distance, left), now.found)
    return March(arcs, xp.maximum(left, LEAST_ROOM), distance, found, now.open & ~hit)


def room(xp: Any, lumens: Any, stations: Stations, point: Vector, arcs: Any) -> tuple[Any, Any]:
    """Arc length of points that were near `arcs`, and the distance from there to the wall along the radius [m].

    Args:
        xp: numpy, jax.numpy, or what writes programs.
        lumens: as for `march`.
        stations: of each world's colon.
        point: places [m].
        arcs: near them [m].
    """
    line = Line(lambda row: _Station(lumens, row), stations.step, stations.first, stations.count)
    found = around(xp, line, lumens.sight.shape[1], point, arcs, nearest=True)
    left = lumens.sight[found.row, found.column] - found.aside
    # The caecum's end is a wall too; before the anus it is open.
    return found.arc, xp.minimum(left, (stations.count - 1 + 0.5) * stations.step - found.arc)


class _Station:
    """A cross-section (`haustra.envs.view.picture.lumen_rays.Station`) of the lumens' arrays."""

    def __init__(self, lumens: Any, row: Any) -> None:
        """At a row of all colons' stations."""
        self._lumens, self._row = lumens, row

    @property
    def middle(self) -> Vector:
        points, row = self._lumens.points, self._row
        return points[row, 0], points[row, 1], points[row, 2]

    @property
    def first(self) -> Vector:
        return self._axis(0)

    @property
    def second(self) -> Vector:
        return self._axis(1)

    @property
    def tangent(self) -> Vector:
        return self._axis(2)

    def _axis(self, axis: int) -> Vector:
        frames, row = self._lumens.frames, self._row
        return frames[row, 0, axis], frames[row, 1, axis], frames[row, 2, axis]
