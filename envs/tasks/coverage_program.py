"""Looking for mucosa within a program of linear time: by the parts of `haustra.envs.tasks.coverage.cell_in_view`.

What was seen of a row of cells around the colon is one number, the sum of 2^column over the cells seen.
"""

from haustra.envs.sim.linear.memory import Lanes
from haustra.envs.sim.linear.program import ScopeProgram
from haustra.envs.sim.linear.sensing import tip_arc
from haustra.envs.sim.linear.trace import Changing, Value
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.coverage import (
    AROUND,
    CELL,
    ROWS_NEAR,
    camera_of,
    cell_place,
    first_row,
    place_in_cone,
    unhidden,
    unseen,
)
from haustra.envs.tasks.ray_program import lumens_of, stations_of


def forget(scopes: ScopeProgram, rows: Lanes, count: int, begins: Value) -> None:
    """Forget all that worlds which begin have seen, in so many rows."""
    with scopes.program.loop(0, count) as row:
        rows.store(row, scopes.program.xp.where(begins, 0.0, rows.load(row)))


def look_around(
    scopes: ScopeProgram, placed: seen_by.Placed, rows: Lanes, cosine: float, looks: Value
) -> tuple[Value, tuple[Value, ...]]:
    """Share of the surface newly seen, and what is told of cells near by that were never seen.

    Args:
        scopes: the program, scopes read off.
        placed: where they are.
        rows: what was seen of each row of cells, which is renewed.
        cosine: of half the viewing angle.
        looks: which worlds look.
    """
    program, xp = scopes.program, scopes.program.xp
    arc, axis = tip_arc(scopes), scopes.axis
    camera = Changing(program, [0.0] * 12)
    lumens, stations = lumens_of(scopes), stations_of(scopes)
    own = camera_of(xp, placed, arc, axis and (lambda place: axis.reference(place, arc)))
    camera.now = (*own.eye, *(part for way in own.frame for part in way))
    cells = -xp.floor(-scopes.length() / CELL)
    low, sums = first_row(xp, arc), Changing(program, [0.0] * 6)
    with program.loop(0, ROWS_NEAR) as more:
        row = low + program.real_of(more)
        there = looks & (row >= 0) & (row < cells)
        slot = xp.int32(xp.clip(row, 0.0, cells - 1))
        mask, bit, fresh = rows.gather(slot), program.variable(1.0), program.variable(0.0)
        clear = program.variable(0.0)
        with program.loop(0, AROUND) as column:
            power = bit.value
            known = xp.floor(mask / power) - 2 * xp.floor(mask / (2 * power)) > 0.5
            now = camera.now
            at = own._replace(eye=now[:3], frame=(now[3:6], now[6:9], now[9:]))
            place, along = cell_place(xp, lumens, stations, xp.clip(row, 0.0, cells - 1), column)
            cell = place_in_cone(xp, at, place, cosine)
            asked = there & cell.seen & ~known
            with program.when(asked):  # of most cells it is known already, or they are out of view: that is quick
                clear.value = xp.where(unhidden(xp, lumens, stations, at, place, along), 1.0, 0.0)
            new = asked & (clear.value > 0)
            missed = there & cell.near & ~known & ~new
            fresh.value = fresh.value + xp.where(new, power, 0.0)
            counts = (xp.where(flag, 1.0, 0.0) for flag in (new, there & cell.near, missed))
            ways = (xp.where(missed, part, 0.0) for part in cell.way)
            sums.now = tuple(total + part for total, part in zip(sums.now, (*counts, *ways), strict=True))
            bit.value = 2 * power
        rows.scatter(slot, mask + fresh.value)
    new, near, missed, *ways = sums.now
    return new / (cells * AROUND), unseen(xp.maximum(near, 1.0), missed, (ways[0], ways[1], ways[2]))
