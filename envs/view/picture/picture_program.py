"""Pictures of many worlds by programs: each pixel's ray to the lumen's table, shaded, exposed and put into bytes.

The same programs are compiled for sixteen pixels of a CPU, and for one of each thread of a graphics processor. They
look into colons where these are now, by the views of `haustra.envs.sim.linear.cameras`. What a place looks like is the
law that every renderer has, `haustra.envs.view.picture.mucosa`.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

from haustra.envs.sim.linear.cameras import ARC, BACKWARDS, EYE, KNOWN, RADIUS, RIGHT, SPACING, UP, VIEW
from haustra.envs.sim.linear.memory import Rows, Shared
from haustra.envs.sim.linear.trace import Changing, Program, Value, nth, order
from haustra.envs.view.picture import lumen_rays
from haustra.envs.view.picture.lumen_rays import (
    FAR,
    INDENTED,
    LARGEST_STEP,
    LEAST_STEP,
    MOST_LOOKS,
    REFINED,
    STEP_PER_DISTANCE,
    Around,
    Line,
    around,
    crossing,
    evened,
    wall_at,
)
from haustra.envs.view.picture.mucosa import Landmark, Scene, Sight, WallPlace, shade
from haustra.envs.view.picture.pixels import Pixels, begun, each_block
from haustra.envs.view.picture.shader import lattice_of, only_where
from haustra.models.wall.moving_colon import node_cell
from haustra.models.wall.sections import Section, carried, carried_normal, lengthening, taken_back
from haustra.models.wall.vectors import Vector, add, between, cross, dot, minus, norm, times

TILE = 8, 4
"""Columns and rows that neighbouring threads of a graphics processor look at."""
LANES = 16
"""Pixels of a CPU that are worked out at a time."""
LOOK = (
    "views",
    "stations",
    "corners",
    "places",
    "known",
    "landmarks",
    "lattice",
    "common",
    "lens",
    "light",
    "distance",
)
LOOK_COUNTS = ("blocks", "pixels", "nodes", "width", "first", "last")
"""Arguments of the program that looks."""
PLACES = ("light", "bright"), ("blocks", "samples", "used", "columns", "width", "pixels", "first", "last")
"""Arguments of the program that measures light."""
RANKS = ("bright", "edges"), ("blocks", "samples", "first", "last")
"""Arguments of the program that finds how bright the upper quarter is."""
DEVELOP = ("light", "distance", "edges", "curve", "pictures"), ("blocks", "pixels", "curve_length", "first", "last")
"""Arguments of the program that makes bytes."""
UPPER = 0.75
"""Share of the lit places that are darker than what exposure goes by (`haustra.envs.view.picture.light.Response`)."""
SPARSE = 4
"""Exposure looks at one of so many rows and columns."""
STATION_ROW, KNOWN_ROW, LANDMARK_ROW = 4, 2, 2
"""Fours of a row of stations, of the wall at an angle of them, and of a landmark."""
LIDS = 2
"""Behind a colon's landmarks stands what is known of the middles of the lids at its anus and its end."""
COLON = 3
"""Where a row of a station says which colon it is of."""


_FLAT = 2e-3
"""The wall's triangles lie at most so far from the wall between the table's numbers, along a ray [m], and share
`_FLAT_SHARE` of its length; engineering choice. Where they seem farther, it is another triangle that the ray meets."""
_FLAT_SHARE = 0.05
"""See there [1]."""
_LEAST_LEFT = 0.02
"""False position leaves this share of the way from either end at least [1]."""


class _Station(NamedTuple):
    """A cross-section (`haustra.envs.view.picture.lumen_rays.Station`); what is not asked for is not read."""

    middle: Vector
    first: Vector
    second: Vector
    tangent: Vector


class _Thing(NamedTuple):
    """Pixels that are worked out together."""

    world: Value
    pixel: Value
    """The first of them."""


def _things(program: Program, given: dict[str, Any], block: Value, size: str) -> _Thing:
    world = block // given["blocks"]
    first = (block - world * given["blocks"]) * program.lanes
    # The last of a world's begin within those before them.
    return _Thing(world, first if program.lanes == 1 else program.xp.minimum(first, given[size] - program.lanes))


def _begun(name: str, arguments: tuple[tuple[str, ...], tuple[str, ...]], lanes: int) -> tuple[Program, dict[str, Any]]:
    return begun(name, *arguments, lanes=lanes, approximate=lanes == 1)


def _in_tiles(program: Program, thing: _Thing, width: Value) -> _Thing:
    """Pixels of `TILE` in the order of a graphics processor's threads: neighbours see the same wall."""
    columns, rows = TILE
    number, within = thing.pixel // (columns * rows), thing.pixel % (columns * rows)
    across = width // columns
    row, column = number // across, number % across
    pixel = (row * rows + within // columns) * width + column * columns + within % columns
    return thing._replace(pixel=pixel)


@functools.cache
def write_look(
    *, lanes: int, moving: bool, kinds: tuple[int, ...], guides: int, angles: int, reach: float, tiled: bool = False
) -> str:
    """The program that follows rays and shades where they end, in LLVM's language.

    Args:
        lanes: pixels at a time; 1 for a graphics processor.
        moving: whether colons move.
        kinds: of the landmarks that a colon may have.
        guides: number of light guides.
        angles: of the table.
        reach: farthest distance that pictures of depth know [m].
        tiled: whether rows and columns of a graphics processor's pictures divide into `TILE`.
    """
    program, given = _begun("look", (LOOK, LOOK_COUNTS), lanes)
    with each_block(program, given["first"], given["last"]) as block:
        thing = _things(program, given, block, "pixels")
        thing = _in_tiles(program, thing, given["width"]) if tiled else thing
        _Looking(program, given, thing, moving, angles).look(kinds, guides, reach)
    return program.finish()


class _Looking:
    """Some pixels of a world's camera."""

    def __init__(self, program: Program, given: dict[str, Any], thing: _Thing, moving: bool, angles: int) -> None:
        self._program, self._xp, self._given, self._thing = program, program.xp, given, thing
        self._moving, self._angles = moving, angles
        self._views = Rows(program, given["views"], VIEW // 4)
        self._row = thing.world * (given["nodes"] + 1)
        stations = Rows(program, given["stations"], STATION_ROW)
        self._corners, self._places = (Rows(program, given[name], 1) for name in ("corners", "places"))

        def station(row: Value) -> _Station:
            return _Station(*(_three(stations, row, 4 * part) for part in range(4)))

        step, first = self._number(2), self._xp.int32(self._number(0))
        self._colon = self._xp.int32(stations.read(first, COLON))
        self._line = Line(station, step, first, self._number(1))
        self._eye, self._eye_arc = self._vector(EYE), self._number(ARC)
        self._axes = self._vector(RIGHT), self._vector(UP), self._vector(BACKWARDS)
        middle = self._axis(self._eye_arc)
        if moving:
            cell = self._cell(self._eye_arc)
            middle = add(middle, between(*cell.places, cell.share))
        about = self._axes[2], self._number(RADIUS), self._eye_arc
        self._tip = lumen_rays.tip_of(program.xp, self._eye, *about, middle)
        pixels = given["pixels"]
        self._lens = Pixels(program, given["lens"], thing.pixel, pixels)
        ray = self._lens.vector(0)
        sides = (times(part, axis) for part, axis in zip(ray, self._axes, strict=True))
        self._own_ray, self._ray = ray, add(add(next(sides), next(sides)), next(sides))

    def look(self, kinds: tuple[int, ...], guides: int, reach: float) -> None:
        program, xp, given, thing = self._program, self._xp, self._given, self._thing
        pixels = given["pixels"]
        within = self._lens.load(4) > 0
        light = Pixels(program, given["light"], thing.world * (3 * pixels) + thing.pixel, pixels)
        for band in range(3):
            light.store(Value(program, program.spread(0.0)), band)
        distance = program.variable(0.0)
        with program.when(within):
            away, met = self._followed(within)
            away = self._on_triangle(away, met)
            distance.value = xp.where(within, xp.where(met, xp.minimum(away, reach), reach), 0.0)
            with program.when(met):
                bands = self._shaded(away, kinds, guides)
                for band, value in enumerate(bands):
                    light.store(xp.where(met, value, 0.0), band)
        Pixels(program, given["distance"], thing.world * pixels + thing.pixel).store(distance.value)

    def _followed(self, within: Value) -> tuple[Value, Value]:
        """How far along their rays pixels see the wall [m], and whether they see any."""
        program, xp = self._program, self._xp
        begun = _Followed(0.0, self._eye_arc, 0.0, self._eye_arc, 0.0, 0.0, LEAST_STEP, 0.0, -LEAST_STEP, 0.0)
        now = Changing(program, begun)
        going = program.variable(xp.where(within, float(MOST_LOOKS), 0.0))
        with program.repeat(lambda: going.value > 0):
            old = _Followed(*now.now)
            way, low, room, high, beyond = old.way, old.low, old.room, old.high, old.beyond
            left, found = self._room(way, old.arc)
            inside = left > 0
            low, room = xp.where(inside, way, low), xp.where(inside, left, room)
            high, beyond = xp.where(inside, high, way), xp.where(inside, beyond, left)
            hit = (old.met > 0) | ~inside
            least = LEAST_STEP + STEP_PER_DISTANCE * way
            further = way + xp.minimum(xp.maximum(0.5 * left, least), LARGEST_STEP + least)
            after = xp.where(hit, crossing(xp, low, room, high, beyond, least=_LEAST_LEFT), further)
            moved, passed = way - old.last_way, found.arc - old.last_arc
            rate = xp.where(
                moved > LEAST_STEP / 2, xp.clip(passed / xp.maximum(moved, LEAST_STEP / 2), -3.0, 3.0), old.rate
            )
            met, ahead = xp.where(hit, old.met + 1.0, 0.0), found.arc + rate * (after - way)
            new = _Followed(after, ahead, way, found.arc, rate, low, room, high, beyond, met)
            moves = going.value > 0
            now.now = tuple(xp.where(moves, own, kept) for own, kept in zip(new, old, strict=True))
            still = moves & (after < FAR) & (met < 1.0 + REFINED)
            going.value = xp.where(still, going.value - 1.0, 0.0)
        end = _Followed(*now.now)
        self._arc = end.arc
        return end.way, end.met > 0

    def _on_triangle(self, away: Value, met: Value) -> Value:
        """How far along its ray the triangle is that the wall is there in the surface made of the table [m].

        Its corners are taken along as that surface's vertices are, and pushed out by the tip.
        """
        program, xp = self._program, self._xp
        flat = program.variable(away)
        with program.when(met):
            rest, _ = self._at_rest(add(self._eye, times(away, self._ray)), self._arc)
            found = around(xp, self._line, self._angles, rest, self._arc)
            beside = xp.where(found.column == self._angles - 1, 0, found.column + 1)
            # On the outside of bends a place may be taken to be past the station that is ahead of it.
            station = xp.int32(xp.floor(xp.clip(found.arc / self._line.step, 0.0, self._line.count - 2)))
            row, after = (self._angles * (self._line.first + station + more) for more in range(2))
            one, other = self._vertex(row + found.column, away), self._vertex(after + beside, away)
            first = dot(self._ray, cross(minus(other, self._eye), minus(one, self._eye))) > 0
            last = self._vertex(xp.where(first, row + beside, after + found.column), away)
            normal = cross(minus(other, one), minus(last, one))
            across = dot(self._ray, normal)
            way = dot(minus(one, self._eye), normal) / xp.where(across * across > 0, across, 1.0)
            # What is no triangle of the wall, such as a lid, stays as it was found; so do NaN.
            near = xp.abs(way - away) < _FLAT + _FLAT_SHARE * away
            on_lid = lumen_rays.lids(xp, self._line, found.arc, self._eye_arc) < LEAST_STEP
            flat.value = xp.where(met & near & (across * across > 0) & ~on_lid, way, away)
        return flat.value

    def _vertex(self, row: Value, away: Value) -> Vector:
        """Where a vertex of the surface made of the table is now [m], for rays that meet wall so far away [m]."""
        xp, program = self._xp, self._program
        rest, arc = _three(self._places, row, 0), self._places.read(row, 3)
        axis = self._axis(arc)
        middle, place = axis, rest
        if self._moving:
            cell = self._cell(arc)
            middle = add(axis, between(*cell.places, cell.share))
            before, after = (carried(section, minus(rest, axis)) for section in cell.sections)
            place = add(middle, between(before, after, cell.share))
        now = Changing(program, place)
        with program.when(away < INDENTED):
            out = minus(place, middle)
            pushed = xp.maximum(lumen_rays.indented(xp, self._tip, middle, arc, place), 0.0)
            now.now = add(place, times(xp.where(away < INDENTED, pushed, 0.0) / norm(xp, out), out))
        x, y, z = now.now
        return x, y, z

    def _room(self, way: Value, arc: Value) -> tuple[Value, Around]:
        """How far a place on the ray is from the wall, along the radius [m], and where it stands."""
        program, xp = self._program, self._xp
        place = add(self._eye, times(way, self._ray))
        rest, middle = self._at_rest(place, arc)
        found = around(xp, self._line, self._angles, rest, arc)
        wall = wall_at(found, self._four(found), self._angles)
        left = program.variable(wall - found.aside)
        with program.when(way < INDENTED):
            pushed = self._indented(found, middle)(place)
            left.value = xp.maximum(left.value, xp.where(way < INDENTED, pushed, -1.0))
        return xp.minimum(left.value, lumen_rays.lids(xp, self._line, found.arc, self._eye_arc)), found

    def _indented(self, found: Around, middle: Vector) -> Callable[[Vector], Value]:
        """How far beyond places the tip pushes the wall, given where they stand and the axis beside them now [m]."""
        beside = middle if self._moving else found.middle
        return lambda place: lumen_rays.indented(self._xp, self._tip, beside, found.arc, place)

    def _four(self, found: Around) -> list[Value]:
        row = found.row * self._angles + found.column
        return [self._corners.read(row, corner) for corner in range(4)]

    def _at_rest(self, place: Vector, arc: Value) -> tuple[Vector, Vector]:
        """Where a place near an arc length stands in the colon at rest, and the axis beside it now [m]."""
        if not self._moving:
            return place, place
        cell = self._cell(arc)
        axis = self._axis(arc)
        middle = add(axis, between(*cell.places, cell.share))
        offset = minus(place, middle)
        about = cell.along, cell.closings, *cell.sections, cell.share
        return add(axis, taken_back(self._xp, offset, cell.stretch, *about)), middle

    def _normal_now(self, normal: Vector, place: Vector, rest: Vector, arc: Value) -> Vector:
        """The wall's normal at rest, as it is now."""
        if not self._moving:
            return normal
        cell, axis = self._cell(arc), self._axis(arc)
        offset = minus(minus(place, axis), between(*cell.places, cell.share))
        way = between(*cell.along, cell.share)
        way = times(1 / norm(self._xp, way), way)
        longer = lengthening(self._xp, offset, minus(rest, axis), cell.stretch, cell.closings)
        normal = add(normal, times(longer * dot(normal, way), way))
        before, after = (carried_normal(section, normal) for section in cell.sections)
        return between(before, after, cell.share)

    def _cell(self, arc: Value) -> "_Cell":
        at, share = node_cell(self._xp, self._number(SPACING), self._number(KNOWN), arc)
        row = self._row + 1 + at

        def three(node: int, column: int) -> Vector:
            return _three(self._views, row + node, column)

        def section(node: int) -> Section:
            turn = self._views.read(row + node, 8), *(self._views.read(row + node, 9 + i) for i in range(3))
            return turn[0], (turn[1], turn[2], turn[3]), self._views.read(row + node, 7), three(node, 12)

        return _Cell(
            share=share,
            places=(three(0, 0), three(1, 0)),
            stretch=self._views.read(row, 3),
            closings=(three(0, 16), three(0, 4)),
            sections=(section(0), section(1)),
            along=(three(0, 20), three(1, 20)),
        )

    def _axis(self, arc: Value) -> Vector:
        """Place of the axis at rest at an arc length [m], straight on beyond its ends as `_line` says."""
        line, xp = self._line, self._xp
        way = arc / line.step
        row = xp.floor(xp.clip(way, 0.0, line.count - 2))
        before, after = (line.at(line.first + xp.int32(row) + more).middle for more in range(2))
        return between(before, after, xp.clip(way - row, 0.0, 1.0))

    def _shaded(self, away: Value, kinds: tuple[int, ...], guides: int) -> Vector:
        program, xp = self._program, self._xp
        place = add(self._eye, times(away, self._ray))
        rest, middle = self._at_rest(place, self._arc)
        found = around(xp, self._line, self._angles, rest, self._arc)
        wall, indented = wall_at(found, self._four(found), self._angles), self._indented(found, middle)
        on_lid = lumen_rays.lids(xp, self._line, found.arc, self._eye_arc) < wall - found.aside
        numbers = self._known(found, on_lid, found.aside / xp.maximum(wall, LEAST_STEP), len(kinds))
        facing = Changing(program, self._normal_now((numbers[0], numbers[1], numbers[2]), place, rest, self._arc))
        pushed = (away < INDENTED) & (indented(place) > wall - found.aside)
        with program.when(pushed):
            slope = lumen_rays.slope(indented, place)
            facing.now = tuple(xp.where(pushed, new, old) for new, old in zip(slope, facing.now, strict=True))
        across, up, back = facing.now
        normal = times(1 / norm(xp, (across, up, back)), (across, up, back))
        seen = tuple(dot(normal, axis) for axis in self._axes)
        # Where a device pushes the wall, the pattern is that of the wall before.
        out = xp.where(on_lid, 1.0, wall / xp.maximum(found.aside, LEAST_STEP))
        rest = add(found.middle, times(out, minus(rest, found.middle)))
        sight = Sight(away, self._own_ray, (seen[0], seen[1], seen[2]), self._lens.load(3))
        at = WallPlace(rest, found.arc, *numbers[3:])
        return shade(xp, at, sight, self._scene(kinds, guides), functools.partial(only_where, program))

    def _known(self, found: Around, on_lid: Value, share: Value, kinds: int) -> list[Value]:
        """Normal at rest and looks of a place of the wall, or of a lid, so far from its middle to its rim [1]."""
        xp, known = self._xp, Rows(self._program, self._given["known"], KNOWN_ROW)
        beside = xp.where(found.column == self._angles - 1, 0, found.column + 1)
        rows = [
            (found.row + station) * self._angles + column for station in range(2) for column in (found.column, beside)
        ]
        lids = Rows(self._program, self._given["landmarks"], LANDMARK_ROW)
        last = xp.int32(xp.where(found.arc > 0.5 * self._line.step * self._line.count, 1.0, 0.0))
        lid = (self._colon * (kinds + LIDS) + kinds) + last
        share, numbers = xp.where(on_lid, xp.minimum(share, 1.0), 1.0), []
        for column in range(4 * KNOWN_ROW):
            middle = lids.read(lid, column)
            numbers.append(middle + share * (evened(found, [known.read(row, column) for row in rows]) - middle))
        return numbers

    def _scene(self, kinds: tuple[int, ...], guides: int) -> Scene:
        program, given = self._program, self._given
        common = Shared(program, given["common"])
        numbers = [common.load(slot) for slot in range(4 + 3 * guides)]
        places = [(numbers[slot], numbers[slot + 1], numbers[slot + 2]) for slot in range(4, len(numbers), 3)]
        table = Rows(program, given["landmarks"], LANDMARK_ROW)
        landmarks = []
        for number, kind in enumerate(kinds):
            row = self._colon * (len(kinds) + LIDS) + number
            landmarks.append(Landmark(kind, _three(table, row, 0), table.read(row, 3), _three(table, row, 4)))
        spread, pixel, wet, mucus = numbers[:4]
        return Scene(lattice_of(program, given["lattice"]), landmarks, self._axes, places, spread, pixel, wet, mucus)

    def _number(self, slot: int) -> Value:
        return self._views.read(self._row, slot)

    def _vector(self, slot: int) -> Vector:
        return _three(self._views, self._row, slot)


class _Followed(NamedTuple):
    """Rays on their way."""

    way: Any
    """Distance at which the wall is looked for next [m]."""
    arc: Any
    """Near which arc length that is [m]."""
    last_way: Any
    """Distance looked at last [m]."""
    last_arc: Any
    """Arc length there [m]."""
    rate: Any
    """How arc length grows with distance [1]."""
    low: Any
    """Farthest distance in the lumen [m]."""
    room: Any
    """Room from there to the wall, along the radius [m]."""
    high: Any
    """Nearest distance in the wall [m]."""
    beyond: Any
    """Room there, below nought [m]."""
    met: Any
    """How often the wall was looked for since it was met."""


class _Cell(NamedTuple):
    """Between which nodes of a colon that moves a place is, and how these are."""

    share: Value
    places: tuple[Vector, Vector]
    stretch: Value
    closings: tuple[Vector, Vector]
    sections: tuple[Section, Section]
    along: tuple[Vector, Vector]


def _three(rows: Rows, row: Value, column: int) -> Vector:
    return rows.read(row, column), rows.read(row, column + 1), rows.read(row, column + 2)


@functools.cache
def write_places(*, lanes: int) -> str:
    """The program that measures light at some places of each picture: the strongest of its bands.

    Of so many `samples` only the first `used` are places; the others are dark, so that there are as many as lanes.
    """
    program, given = _begun("measure", PLACES, lanes)
    xp = program.xp
    with each_block(program, given["first"], given["last"]) as block:
        thing, columns = _things(program, given, block, "samples"), given["columns"]
        number = _numbered(program, thing.pixel)
        sample = xp.minimum(number, given["used"] - 1)
        row = xp.int32(xp.floor((program.real_of(sample) + 0.5) / program.real_of(columns)))
        pixel = (row * given["width"] + (sample - row * columns)) * SPARSE
        light, bands = Shared(program, given["light"]), given["pixels"]
        first, second, third = (light.load(pixel + (thing.world * 3 + band) * bands) for band in range(3))
        bright = Pixels(program, given["bright"], thing.world * given["samples"] + thing.pixel)
        bright.store(xp.where(number < given["used"], xp.maximum(xp.maximum(first, second), third), 0.0))
    return program.finish()


@functools.cache
def write_ranks(*, lanes: int) -> str:
    """The program that finds numpy's percentile of each picture's lit places, by how many are darker than each.

    Of each picture it leaves the two that the percentile lies between, and the share of the way between them.
    """
    program, given = _begun("rank", RANKS, lanes)
    xp = program.xp
    with each_block(program, given["first"], given["last"]) as block:
        thing, samples = _things(program, given, block, "samples"), given["samples"]
        table, start = Shared(program, given["bright"]), thing.world * samples
        own = Pixels(program, given["bright"], start + thing.pixel).load()
        number = program.real_of(_numbered(program, thing.pixel))
        darker, lit = program.variable(0.0), program.variable(0.0)
        with program.loop(0, samples) as other:
            light = table.load(start + other)
            before = (light < own) | ((light == own) & (program.real_of(other) < number))
            darker.value = darker.value + xp.where((light > 0) & before, 1.0, 0.0)
            lit.value = lit.value + xp.where(light > 0, 1.0, 0.0)
        place = UPPER * xp.maximum(lit.value - 1, 0.0)
        low = xp.floor(place)
        edges = Shared(program, given["edges"])
        for slot, rank in enumerate((low, xp.minimum(low + 1, xp.maximum(lit.value - 1, 0.0)))):
            with program.when((own > 0) & (darker.value == rank)):
                _put(program, edges, thing.world * 4 + slot, own, (own > 0) & (darker.value == rank))
        with program.when(number < 1):
            _put(program, edges, thing.world * 4 + 2, place - low, number < 1)
    return program.finish()


def _put(program: Program, edges: Shared, slot: Value, value: Value, condition: Value) -> None:
    """Put the number of the one lane in which a condition holds."""
    if program.lanes == 1:
        edges.store(slot, value)
        return
    for lane in range(program.lanes):
        at = nth(lane)
        one, held = (
            Value(program, program.builder.extract_element(program.spread(each), at)) for each in (value, condition)
        )
        edges.store(slot, program.xp.where(held, one, edges.load(slot)))


def _numbered(program: Program, first: Value) -> Value:
    """Whole numbers of things that stand side by side."""
    if program.lanes == 1:
        return first
    return first + Value(program, order(*range(program.lanes)))


@functools.cache
def write_develop(*, lanes: int, target: float, reach: float) -> str:
    """The program that exposes light, and packs bytes of red, green, blue and distance into one whole number a pixel.

    Args:
        lanes: as in `write_look`.
        target: as in `haustra.envs.view.picture.light.Response`.
        reach: as in `write_look`.
    """
    program, given = _begun("develop", DEVELOP, lanes)
    xp = program.xp
    with each_block(program, given["first"], given["last"]) as block:
        thing, pixels = _things(program, given, block, "pixels"), given["pixels"]
        light = Pixels(program, given["light"], thing.world * (3 * pixels) + thing.pixel, pixels)
        edges, curve = Shared(program, given["edges"]), Shared(program, given["curve"], whole=True)
        low, high, share = (edges.load(thing.world * 4 + slot) for slot in range(3))
        gain = target / xp.maximum(low + share * (high - low), 1e-12)
        top = program.real_of(given["curve_length"] - 1)
        red, green, blue = (curve.load(xp.int32(xp.minimum(gain * light.load(band), 1.0) * top)) for band in range(3))
        place = thing.world * pixels + thing.pixel
        depth = xp.int32(xp.rint(Pixels(program, given["distance"], place).load() * (255 / reach)))
        # The last byte's upper half makes a whole number negative.
        last = xp.where(depth < 128, depth, depth - 256)
        packed = red + green * 2**8 + blue * 2**16 + last * 2**24
        Pixels(program, given["pictures"], place, whole=True).store(packed)
    return program.finish()
