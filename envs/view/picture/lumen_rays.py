"""Rays to the wall that a lumen's table describes: where a place stands in it, and where a ray comes out.

The table is read in one of two ways. At its nearest number (`haustra.envs.tasks.sight`), as depth pictures and rays in
observations do, in a few looks along each. Or smoothly, for pictures in colour (`picture_program`): between stations
a place counts to both cross-sections by how far it is from either; between angles the wall is flat, as that of the
surface which is made of the table, so that neighbouring rays meet one smooth wall. Such a ray goes on by half of the
room it has, and never by less than a little. Where a ray comes out, the wall is found by false position.

Laws are over numbers of any kind: those of numpy and JAX, and of what writes programs.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from haustra.models.wall.indentation import FALL, GAP, TOP, reached
from haustra.models.wall.vectors import Vector, add, between, dot, minus, norm, times

FAR = 0.35
"""Wall is looked for as far as this along a ray [m]; engineering choice, since light from there is a 34th of that from
6 cm."""
MOST_LOOKS = 200
"""A ray is looked for so often at most."""
REFINED = 1
"""So many of these between the last place in the lumen and the first in the wall."""
LEAST_STEP, STEP_PER_DISTANCE, LARGEST_STEP = 2.5e-4, 0.01, 0.01
"""A ray goes on by at least this [m], and this share of how far it has come; and by at most this more [m]. Each is an
engineering choice."""
INDENTED = 0.045
"""Farther than this from the camera its own device indents no wall in pictures [m]; engineering choice."""
_WINDOW = 0.02
"""Largest change of arc length from one place on a ray to the next [m]; engineering choice."""
_LEAST_CELL = 0.1
"""Stations count as if no nearer to each other, on the inside of bends, than this share of their distance [1]."""
_NEAR_BY = 5e-4
"""Slopes are those between places so far to either side [m]; engineering choice."""
_STATIONS = 8.0
"""A place is taken to be at most so many stations from the one it was found next to [1]."""
_OPEN = 2e-3
"""A camera that is no further in than this looks out through the anus, which else is a wall [m]; engineering choice."""


class Station(Protocol):
    """A cross-section of the colon at rest; its parts are read when they are asked for."""

    @property
    def middle(self) -> Vector:
        """Place of the centreline [m]."""
        ...

    @property
    def first(self) -> Vector:
        """First normal."""
        ...

    @property
    def second(self) -> Vector:
        """Second normal."""
        ...

    @property
    def tangent(self) -> Vector:
        """Direction of the centreline."""
        ...


class Line(NamedTuple):
    """The stations of one colon."""

    at: Callable[[Any], Station]
    """Gives that of a row of the table."""
    step: Any
    """Distance between stations [m]."""
    first: Any
    """Row of the first: a whole number."""
    count: Any
    """How many there are: a real number."""


class Around(NamedTuple):
    """Where a place stands in a table."""

    arc: Any
    """Arc length beside it [m]."""
    row: Any
    """Row of the station before it."""
    share: Any
    """Share of the way to the next station [1]."""
    column: Any
    """Angle before it."""
    turn: Any
    """Share of the way to the next angle [1]."""
    aside: Any
    """Distance from the centreline [m]."""
    middle: Vector
    """Place of the centreline beside it [m]."""


def around(xp: Any, line: Line, angles: int, point: Vector, arc: Any, *, nearest: bool = False) -> Around:
    """Where a place of the colon at rest stands that is near an arc length.

    Args:
        xp: numpy, or what writes programs.
        line: the colon's stations.
        angles: of the table.
        point: the place [m].
        arc: near it [m].
        nearest: at the nearest station and angle, with nought as the shares of the way to the next.
    """
    station = _row(xp, line, arc, nearest)
    near = line.at(line.first + xp.int32(station))
    ahead = dot(minus(point, near.middle), near.tangent)
    arc = station * line.step + xp.clip(ahead, -_WINDOW, _WINDOW)
    row = _row(xp, line, arc, nearest)
    if nearest:
        row = line.first + xp.int32(row)
        own = line.at(row)
        offset = minus(point, own.middle)
        x, y = dot(offset, own.first), dot(offset, own.second)
        column = xp.int32(xp.rint(xp.arctan2(y, x) * (angles / (2 * np.pi)))) % angles
        return Around(arc, row, 0.0, column, 0.0, xp.sqrt(x * x + y * y), own.middle)
    before, after = line.at(line.first + xp.int32(row)), line.at(line.first + xp.int32(row) + 1)
    one, other = minus(point, before.middle), minus(point, after.middle)
    way, back = dot(one, before.tangent), -dot(other, after.tangent)
    along = way / xp.maximum(way + back, _LEAST_CELL * line.step)
    share = xp.clip(along, 0.0, 1.0)
    x = (1 - share) * dot(one, before.first) + share * dot(other, after.first)
    y = (1 - share) * dot(one, before.second) + share * dot(other, after.second)
    angle = xp.arctan2(y, x) * (angles / (2 * np.pi))
    begin = xp.floor(angle)
    column = xp.where(begin < 0, begin + angles, begin)
    column = xp.int32(xp.where(column >= angles, column - angles, column))
    return Around(
        arc=(row + xp.clip(along, -_STATIONS, _STATIONS)) * line.step,
        row=line.first + xp.int32(row),
        share=share,
        column=column,
        turn=angle - begin,
        aside=xp.sqrt(x * x + y * y),
        middle=between(before.middle, after.middle, share),
    )


def _row(xp: Any, line: Line, arc: Any, nearest: bool) -> Any:
    """Station before an arc length, or the nearest."""
    way = arc / line.step
    return xp.clip(xp.rint(way), 0.0, line.count - 1) if nearest else xp.clip(xp.floor(way), 0.0, line.count - 2)


def crossing(xp: Any, low: Any, room: Any, high: Any, beyond: Any, *, least: float = 0.0) -> Any:
    """Where on a ray the wall is, between a place in the lumen and one in the wall [m], by false position.

    Args:
        xp: numpy, or what writes programs.
        low: distance of the place in the lumen [m].
        room: from there to the wall [m].
        high: distance of the place in the wall [m].
        beyond: the same from there, below nought [m].
        least: share of the way from either place that is left at least [1].
    """
    share = room / xp.maximum(room - beyond, 1e-9)
    return low + xp.clip(share, least, 1 - least) * (high - low)


def evened(found: Around, corners: Sequence[Any]) -> Any:
    """A number of a place from those at both stations beside it, first at the angle before and then at the next."""
    a, b, c, d = corners
    before, after = a + found.turn * (b - a), c + found.turn * (d - c)
    return before + found.share * (after - before)


def wall_at(found: Around, corners: Sequence[Any], angles: int) -> Any:
    """How far the wall is from the centreline towards a place [m]; a chord from angle to angle."""
    sag = 0.5 * (2 * np.pi / angles) ** 2
    return evened(found, corners) * (1 - sag * found.turn * (1 - found.turn))


class Tip(NamedTuple):
    """The device behind a camera."""

    end: Vector
    """Place of the camera [m]."""
    behind: Vector
    """Direction from there along the device."""
    radius: Any
    """Radius of the device [m]."""
    arc: Any
    """Arc length beside the camera [m]."""
    top: Any
    """How far from the centreline the wall over the tip stands at most [m] (`haustra.models.wall.indentation.tops`)."""


def tip_of(xp: Any, end: Vector, behind: Vector, radius: Any, arc: Any, middle: Vector) -> Tip:
    """The device behind a camera, given the place of the centreline beside that [m]."""
    return Tip(end, behind, radius, arc, norm(xp, minus(end, middle)) + TOP * (radius + GAP))


def indented(xp: Any, tip: Tip, middle: Vector, arc: Any, place: Vector) -> Any:
    """How far beyond a place the device's tip pushes the wall [m], as surfaces that make room for it have it.

    Args:
        xp: numpy, or what writes programs.
        tip: the device.
        middle: of the centreline beside the place, as it is now [m].
        arc: arc length there [m].
        place: see there [m].
    """
    off = minus(place, middle)
    aside = norm(xp, off)
    ray, most = times(1 / aside, off), -1.0
    for ball in np.linspace(1.0, 3.0, 5).tolist():
        away = minus(add(tip.end, times(tip.radius * ball, tip.behind)), middle)
        falls = tip.top - FALL * xp.abs(tip.arc - tip.radius * ball - arc)
        most = xp.maximum(xp.minimum(reached(xp, away, ray, tip.radius + GAP), falls), most)
    return most - aside


def slope(law: Callable[[Vector], Any], place: Vector) -> Vector:
    """Gradient of a number over a place."""

    def change(step: Vector) -> Any:
        return (law(add(place, step)) - law(minus(place, step))) / (2 * _NEAR_BY)

    return change((_NEAR_BY, 0.0, 0.0)), change((0.0, _NEAR_BY, 0.0)), change((0.0, 0.0, _NEAR_BY))


def lids(xp: Any, line: Line, arc: Any, eye: Any) -> Any:
    """Distance along the colon to its end, or to the anus for a camera at an arc length `eye` inside [m]."""
    return xp.minimum((line.count - 1) * line.step - arc, arc - xp.minimum(eye - _OPEN, 0.0))
