"""Rays of sight within a program of linear time: `haustra.envs.tasks.sight.march`, which numpy and JAX call too."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, final

import numpy as np
from jaxtyping import Float

from haustra.envs.sim.linear.layout import NODE, seen_slot
from haustra.envs.sim.linear.program import ScopeProgram
from haustra.envs.sim.linear.sensing import tip_arc
from haustra.envs.sim.linear.trace import Value
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.sight import FIRST_ROOM, RANGE, STEPS, March, Sight, Stations, march, ray_directions
from haustra.errors import InvalidOptionError

_RAYS, _TABLE = len(STEPS), len(STEPS) + ray_directions().size
"""Where the rays' directions and the table of distances begin behind the places on a ray."""
_MOST_STARTS = 2**24
"""Numbers of starts beyond which single precision does not count them."""
_MARGIN = 0.02
"""A ray may be looked up so far beyond its range [m]."""


def lookup_of(sight: Sight, starts: Float[np.ndarray, "colons slots"] | None = None) -> Float[np.ndarray, " numbers"]:
    """What episodes look up besides the colons' centrelines.

    First comes where rays begin, then states that episodes begin from, colon by colon; then places on a ray, the rays,
    and distances to the lumen.

    Raises:
        InvalidOptionError: when there are more states than can be counted.
    """
    begin = np.zeros(0) if starts is None else starts.ravel()
    if len(begin) >= _MOST_STARTS:
        raise InvalidOptionError(
            f"Starts of {0 if starts is None else len(starts)} colons are too many to look up: give fewer seeds."
        )
    return np.concatenate([[1 + len(begin)], begin, STEPS, ray_directions().ravel(), sight.lumens.sight.ravel()])


def begin_from(scopes: ScopeProgram, begins: Value, case: Value) -> None:
    """Put scopes that begin, and their colons, where the looked-up state of their colon has them."""
    program, xp, layout = scopes.program, scopes.program.xp, scopes.layout
    first = xp.int32(case) * (layout.axis + layout.nodes * NODE) + 1

    def put(slot: Value, place: Value) -> None:
        scopes.state.store(slot, xp.where(begins, scopes.lookup.gather(first + place), scopes.state.load(slot)))

    with program.loop(0, layout.axis) as slot:
        put(slot, slot)
    with program.loop(0, layout.nodes) as node:
        for number in range(NODE):
            slot = layout.node_state(number) + node * (NODE if layout.abreast == 1 else 1)
            put(slot, layout.axis + node * NODE + number)


def lumens_of(scopes: ScopeProgram) -> SimpleNamespace:
    """The colons' tables as rays read them."""
    tables = scopes.tables
    return SimpleNamespace(points=tables.points, frames=tables.frames, sight=_Distances(scopes))


def stations_of(scopes: ScopeProgram) -> Stations:
    """Those of each world's colon."""
    return Stations(scopes.world("step"), scopes.program.xp.int32(scopes.world("first")), scopes.world("count"))


def _rays(scopes: ScopeProgram) -> Value:
    """Where rays begin in what is looked up."""
    return scopes.program.xp.int32(scopes.lookup.load(0))


@final
@dataclass(frozen=True)
class LumenSight:
    """Sight of programs for who decides outside them: tells what `haustra.envs.tasks.observation.lumen` says."""

    tells: int = seen_by.LUMEN_SIZE

    def write(self, scopes: ScopeProgram, first: int) -> None:
        """Look from all tips, and tell, an entry a row from the first on."""
        xp = scopes.program.xp
        look(scopes, placed_of(scopes), lambda at, value: scopes.told.store(at + first, seen_by.clipped(xp, value)))


def placed_of(scopes: ScopeProgram, coils: Sequence[int] = ()) -> seen_by.Placed:
    """Where scopes are that were read off.

    Args:
        scopes: the program.
        coils: which of the places that are read off each of the imager's coils has.
    """
    rows = [scopes.seen.vector(seen_slot("tip_frame") + 3 * row) for row in range(3)]
    columns = [(rows[0][axis], rows[1][axis], rows[2][axis]) for axis in range(3)]
    places = [scopes.seen.vector(seen_slot("coils") + 3 * place) for place in coils]
    return seen_by.Placed(scopes.seen.vector(seen_slot("tip")), (columns[0], columns[1], columns[2]), places)


def look(scopes: ScopeProgram, placed: seen_by.Placed, tell: Callable[[Any, Value], None]) -> None:
    """What `haustra.envs.tasks.observation.lumen` says, entry by entry.

    Args:
        scopes: the program, scopes read off.
        placed: where they are.
        tell: takes an entry's number and the entry.
    """
    program, lookup = scopes.program, scopes.lookup
    if scopes.axis:
        scopes.axis.shape(tip_arc(scopes) + (RANGE + _MARGIN))
    sums, rays = [program.variable(0.0) for _ in range(3)], _rays(scopes)
    with program.loop(0, len(ray_directions())) as ray:
        own = [lookup.load(rays + (_RAYS + ray * 3 + part)) for part in range(3)]
        near = _distance(scopes, placed, own) / RANGE
        tell(ray, near)
        weight = seen_by.depth_weight(near)
        for total, share in zip(sums, (own[0], own[1], 1.0), strict=True):
            total.value = total.value + weight * share
    up, left, whole = (total.value for total in sums)
    tell(len(ray_directions()), up / whole)
    tell(len(ray_directions()) + 1, left / whole)


def _distance(scopes: ScopeProgram, placed: seen_by.Placed, ray: list[Value]) -> Value:
    """To the wall along a ray that is given in the tip's frame [m]."""
    program, lumens, stations, rays = scopes.program, lumens_of(scopes), stations_of(scopes), _rays(scopes)
    direction, at_rest = placed.from_frame((ray[0], ray[1], ray[2])), scopes.axis and scopes.axis.reference
    begun = March(tip_arc(scopes), FIRST_ROOM, 0.0, float(STEPS[-1]), 1.0)
    now = March(*(program.variable(value) for value in begun))
    with program.loop(0, len(STEPS)) as place:
        still = now.open.value > 0
        with program.when(still):
            here = March(*(part.value for part in now))._replace(open=still)
            distance = scopes.lookup.load(rays + place)
            there = march(program.xp, lumens, stations, placed.tip, direction, here, distance, at_rest)
            there = there._replace(open=program.xp.where(there.open, 1.0, 0.0))
            for part, value in zip(now, there, strict=True):
                part.value = value
    return now.found.value


class _Distances:
    """Distance from the centreline to the lumen, by row and angle, in what is looked up, as wide as gas holds it."""

    def __init__(self, scopes: ScopeProgram) -> None:
        self._scopes, self._first = scopes, _rays(scopes) + _TABLE
        self.shape = scopes.tables.wall.shape

    def __getitem__(self, at: tuple[Value, Value]) -> Value:
        row, angle = at
        distance, gas = self._scopes.lookup.gather(row * self.shape[1] + angle + self._first), self._scopes.gas
        return gas.width(row) * distance if gas else distance
