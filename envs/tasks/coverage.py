"""How much of the mucosa a camera has seen: cells of the wall that were in view, near, and not behind a fold.

Of a colon that moves, the camera is looked from where it would be had the colon not moved: what stretches, pleats and
turns the colon at the tip is undone, so that mucosa in pleats counts as if these were smoothed out.
"""

import math
from collections.abc import Callable, Sequence
from functools import reduce
from operator import and_
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.envs.tasks.case import TabulatedColon
from haustra.envs.tasks.observation import Placed
from haustra.envs.tasks.sight import Sight, Stations, room
from haustra.models.anatomy.surface_landmarks import inspection_number
from haustra.models.wall import vectors
from haustra.models.wall.vectors import Vector, add, dot, minus, norm, times

CELL = 0.005
"""Length of a cell along the colon [m]; it is a twenty-fourth of the circumference wide: about 5 mm."""
AROUND = 24
"""Cells around the colon."""
NEAR = inspection_number("near")
"""A cell farther from the camera than this [m] does not count as seen."""
ROWS_NEAR = math.ceil(2 * (NEAR + CELL) / CELL) + 1
"""Rows of cells that may be near a camera."""
LOOK_EVERY = 0.2
"""Time from one look to the next [s], in which a tip moves by 12 mm at most; engineering choice."""
_BETWEEN = np.linspace(0.2, 0.9, 6)
"""Places on the line of sight that must lie in the lumen."""
_AXIS = 0.005
"""Length by which directions are taken back to a colon at rest [m]; engineering choice, short beside a lumen."""


class Camera(NamedTuple):
    """A camera in the colon at rest; vectors of one number a world."""

    eye: Vector
    """Its place [m]."""
    frame: tuple[Vector, Vector, Vector]
    """Directions of wires 'up' and 'left', and the viewing direction: unit vectors."""
    arc: Any
    """Arc length there [m]."""


class Cell(NamedTuple):
    """A cell of the wall as a camera has it."""

    near: Any
    """Whether it is near enough to be seen."""
    seen: Any
    """Whether it is in view."""
    way: Vector
    """Direction from the eye: unit vector towards wires 'up' and 'left', and ahead."""


def camera_of(xp: Any, placed: Placed, arc: Any, at_rest: Callable[[Vector], Vector] | None) -> Camera:
    """The tip's camera, taken back to the colon at rest.

    Args:
        xp: numpy, or what writes programs.
        placed: where the tip is.
        arc: arc length there [m].
        at_rest: takes places near the tip back; None of colons that stand still.
    """
    if at_rest is None:
        return Camera(placed.tip, placed.frame, arc)
    eye = at_rest(placed.tip)
    ways = [minus(at_rest(add(placed.tip, times(_AXIS, axis))), eye) for axis in placed.frame]
    up, left, ahead = (times(1 / norm(xp, way), way) for way in ways)
    return Camera(eye, (up, left, ahead), arc)


def cell_in_view(
    xp: Any, lumens: Any, stations: Stations, camera: Camera, row: Any, column: Any, cosine: float
) -> Cell:
    """How a cell of the wall, by its row along the colon and its column around it, is seen.

    Args:
        xp: numpy, or what writes programs.
        lumens: the colons: `points`, `frames` and `sight` of stations are read.
        stations: of the cell's colon.
        camera: that looks.
        row: cells of 5 mm from the anus.
        column: of `AROUND`.
        cosine: of half the full viewing angle.
    """
    place, arc = cell_place(xp, lumens, stations, row, column)
    return place_in_view(xp, lumens, stations, camera, place, arc, cosine)


def cell_place(xp: Any, lumens: Any, stations: Stations, row: Any, column: Any) -> tuple[Vector, Any]:
    """Where a cell lies in the colon at rest, and the arc length there [m]; arguments as of `cell_in_view`."""
    arc, angles = CELL * row, lumens.sight.shape[1]
    station = stations.first + xp.int32(xp.clip(xp.rint(arc / stations.step), 0.0, stations.count - 1))
    radius, turn = lumens.sight[station, column * (angles // AROUND)], (2 * math.pi / AROUND) * column
    middle, first, second = (
        _vector(table, station, axis) for table, axis in ((lumens.points, None), (lumens.frames, 0), (lumens.frames, 1))
    )
    outwards = add(times(radius * xp.cos(turn), first), times(radius * xp.sin(turn), second))
    return add(middle, outwards), arc


def place_in_view(
    xp: Any, lumens: Any, stations: Stations, camera: Camera, place: Vector, arc: Any, cosine: float
) -> Cell:
    """How a place on the wall is seen; arguments as of `cell_in_view`.

    Args:
        xp: numpy, or what writes programs.
        lumens: the colons.
        stations: of the place's colon.
        camera: that looks.
        place: in the colon at rest [m].
        arc: arc length there [m].
        cosine: of half the full viewing angle.
    """
    cell = place_in_cone(xp, camera, place, cosine)
    return cell._replace(seen=cell.seen & unhidden(xp, lumens, stations, camera, place, arc))


def place_in_cone(xp: Any, camera: Camera, place: Vector, cosine: float) -> Cell:
    """`place_in_view` as if nothing hid the place."""
    way = minus(place, camera.eye)
    distance = norm(xp, way) + 1e-9
    own = tuple(dot(axis, way) / distance for axis in camera.frame)
    near = distance < NEAR
    return Cell(near, near & (own[2] > cosine), (own[0], own[1], own[2]))


def unhidden(xp: Any, lumens: Any, stations: Stations, camera: Camera, place: Vector, arc: Any) -> Any:
    """Whether no wall hides a place from a camera; arguments as of `place_in_view`."""
    way = minus(place, camera.eye)

    def clear(share: float) -> Any:
        between = add(camera.eye, times(share, way))
        _, left = room(xp, lumens, stations, between, camera.arc + share * (arc - camera.arc))
        return left > 0

    return reduce(and_, map(clear, _BETWEEN.tolist()))


def first_row(xp: Any, arc: Any) -> Any:
    """First row of cells that may be near a camera at an arc length [m]; there are `ROWS_NEAR`."""
    return xp.floor((arc - NEAR - CELL) / CELL)


def unseen(near: Any, missed: Any, ways: Vector) -> tuple[Any, ...]:
    """What is told of cells near the camera that were never seen: their share and mean direction, entry by entry.

    Args:
        near: cells near the camera, one at least.
        missed: how many of them were never seen.
        ways: sum of the directions of these, in the tip's frame.
    """
    return missed / near, *(part / near for part in ways)


def half_angle_cosine(field_of_view_deg: float) -> float:
    """Cosine of half a full viewing angle [degrees]."""
    return math.cos(math.radians(min(field_of_view_deg, 359.0) / 2))


class Coverage:
    """Cells seen, world by world."""

    def __init__(self, cases: Sequence[TabulatedColon], sight: Sight, worlds: int, *, field_of_view_deg: float) -> None:
        """Nothing seen yet; a cell counts within `field_of_view_deg` of full viewing angle."""
        self._sight, self._cosine = sight, half_angle_cosine(field_of_view_deg)
        self._rows = [math.ceil(case.length / CELL) for case in cases]
        self._seen = [np.zeros((0, AROUND), bool) for _ in range(worlds)]

    def begin(self, world: int, case: int) -> None:
        """Forget what one world has seen."""
        self._seen[world] = np.zeros((self._rows[case], AROUND), bool)

    def look(self, world: int, case: int, camera: Camera) -> tuple[float, tuple[float, ...]]:
        """Look from a camera; the share of all cells seen so far, and what `unseen` tells."""
        seen, lumens = self._seen[world], self._sight.lumens
        low = int(first_row(np, camera.arc))
        rows, columns = np.arange(max(low, 0), min(low + ROWS_NEAR, len(seen))), np.arange(AROUND)
        row, column = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
        stations = Stations(lumens.step[case], lumens.first[case], np.float32(lumens.count[case]))
        found = cell_in_view(np, lumens, stations, camera, row, column, self._cosine)
        seen[row[found.seen], column[found.seen]] = True
        missed = found.near & ~seen[row, column]
        ways = tuple(float(part[missed].sum()) for part in found.way)
        about = unseen(max(int(found.near.sum()), 1), int(missed.sum()), (ways[0], ways[1], ways[2]))
        return float(seen.mean()), about


def cameras_at_rest(
    placed: Placed,
    arc: Float[np.ndarray, " worlds"],
    back: Callable[[Any, Any], Any] | None,
) -> Camera:
    """Cameras of all worlds at once; `back` takes places near arc lengths to the colons at rest."""

    def at_rest(place: Vector) -> Vector:
        assert back is not None, "colons that stand still"
        return vectors.of(back(vectors.stacked(np, place)[:, None], arc[:, None])[:, 0])

    return camera_of(np, placed, arc, None if back is None else at_rest)


def camera_in(cameras: Camera, world: int) -> Camera:
    """The camera of one world."""

    def one(v: Vector) -> Vector:
        return v[0][world], v[1][world], v[2][world]

    up, left, ahead = cameras.frame
    return Camera(one(cameras.eye), (one(up), one(left), one(ahead)), cameras.arc[world])


def _vector(table: Any, row: Any, axis: int | None) -> Vector:
    if axis is None:
        return table[row, 0], table[row, 1], table[row, 2]
    return table[row, 0, axis], table[row, 1, axis], table[row, 2, axis]
