"""A colon that moves on its mesentery, in programs: the laws of `haustra.models.wall.moving_colon`, node by node."""

from typing import Any, NamedTuple

from haustra.envs.sim.linear.layout import AXIS, NODE, NODE_ROOM, WORLD, Layout
from haustra.envs.sim.linear.memory import Lanes, Rows
from haustra.envs.sim.linear.trace import Program, Value
from haustra.models.injury.pain import axial_tension, mesentery_tension
from haustra.models.wall.lumen_table import Tables, axis_point
from haustra.models.wall.moving_colon import (
    bend_gradient,
    edge_resistance,
    edge_tension,
    hold_force,
    node_cell,
    node_resistance,
    taken_back,
    turn_gradient,
    turn_rate,
    turned,
)
from haustra.models.wall.vectors import Vector, add, between, cross, dot, minus, norm, times, unit_rate

_UNIT, _LENGTH, _TANGENT, _SUM, _COSINE, _TURN = 0, 3, 4, 7, 8, 9
_COSINE_RATE, _TURN_RATE, _COUPLES, _PULLED, _GRIPPED = 12, 13, 16, 25, 28
_DIAGONAL, _TIE, _OVER = 29, 30, 31
"""What each node's room holds."""


class Cell(NamedTuple):
    """Between which nodes something is."""

    at: Value
    """The node before."""
    share: Value
    """How much of the way to the next is behind it [1]."""


class Axis:
    """The axis of each world's colon."""

    def __init__(
        self,
        program: Program,
        layout: Layout,
        arrays: tuple[Lanes, Lanes, Lanes],
        rows: Rows,
        tables: tuple[Tables, tuple[Value, Value, Value]],
    ) -> None:
        """Bind it.

        Args:
            program: to write to.
            layout: of states and rooms.
            arrays: states, worlds and rooms.
            rows: of the nodes of all colons at rest.
            tables: with the stations of the world's colon.
        """
        self.program, self.layout, self.nodes = program, layout, layout.nodes
        self._state, self._world, self._room = arrays
        self._rows = rows
        self._tables, self._stations = tables

    def shape(self) -> None:
        """Find how the axes lie, and let nothing press on them."""
        program, xp, room = self.program, self.program.xp, self._room
        last = self.nodes - 1
        with program.loop(0, last) as i:
            edge = minus(self._now(i + 1), self._now(i))
            length = norm(xp, edge)
            unit = times(1 / length, edge)
            rate = unit_rate(unit, length, minus(self.speed(i + 1), self.speed(i)))
            room.put(self._node(i) + _UNIT, (*unit, length))
            room.put(self._node(i) + _OVER, rate)
        with program.loop(0, self.nodes) as i:
            own, (inner, here, before) = self._node(i), self._edges(i)
            total, rate = (
                add(room.vector(here + slot), times(inner, room.vector(before + slot))) for slot in (_UNIT, _OVER)
            )
            size, rest = norm(xp, total), self._vector(i, "tangent")
            tangent = times(1 / size, total)
            rate = unit_rate(tangent, size, rate)
            room.put(own + _TANGENT, (*tangent, size, dot(rest, tangent), *cross(rest, tangent)))
            room.put(own + _COSINE_RATE, (dot(rest, rate), *cross(rest, rate)))
            room.put(own + _COUPLES, [0.0] * 13)

    def reference(self, place: Vector, arc: Value) -> Vector:
        """Where a place near an arc length stands in the colon at rest."""
        xp, cell = self.program.xp, self._cell(arc)
        axis, moved = self._axis(arc), self.moved(arc)
        stretch = self._room.gather(self._node(cell.at) + _LENGTH) / self._number(cell.at, "length")
        along = between(self._vector(cell.at, "tangent"), self._vector(cell.at + 1, "tangent"), cell.share)
        offset = minus(minus(place, axis), moved)
        return add(axis, taken_back(xp, offset, stretch, along, *self._turns(cell), cell.share))

    def moved(self, arc: Value) -> Vector:
        """How far the axis has moved from rest at an arc length [m]."""
        cell = self._cell(arc)
        before, after = (self._state.gather_vector(self._place(cell.at + i)) for i in range(2))
        return between(before, after, cell.share)

    def carried(self, arc: Value, normal: Vector, surface: Vector) -> tuple[Vector, Vector, Vector]:
        """Normal as it stands now, lever of a place on the wall at rest, and the wall's speed there.

        Args:
            arc: of the place.
            normal: at rest.
            surface: the place in the colon at rest.
        """
        xp, cell = self.program.xp, self._cell(arc)
        before, after = self._turns(cell)
        now = between(turned(xp, *before, normal), turned(xp, *after, normal), cell.share)
        held = minus(surface, self._axis(arc))

        def speed(node: Value, turn: tuple[Value, Vector]) -> Vector:
            slot = self._node(node)
            rate = self._room.gather(slot + _COSINE_RATE), self._room.gather_vector(slot + _TURN_RATE)
            moving = self._state.gather_vector(self._place(node) + 3)
            return add(moving, turn_rate(xp, *turn, *rate, held))

        moving = between(speed(cell.at, before), speed(cell.at + 1, after), cell.share)
        return times(1 / norm(xp, now), now), held, moving

    def press(self, arc: Value, held: Vector, force: Vector, damping: Value) -> None:
        """Let a force on the wall [N] act, damped by so much [N s/m], where its lever is held."""
        cell = self._cell(arc)
        for later in range(2):
            slot, part = self._node(cell.at + later), cell.share if later else 1 - cell.share
            shared = times(part, force)
            values = [*(shared[i] * held[j] for i in range(3) for j in range(3)), *shared, part * damping]
            for more, value in enumerate(values):
                self._room.add_at(slot + (_COUPLES + more), value)

    def step(self, h: float, fastest: Any, limit: float) -> None:
        """Let the axes give way for a time step [s]; `fastest` keeps what is faster than a limit."""
        program, xp, room = self.program, self.program.xp, self._room
        self._bend()
        last = self.nodes - 1
        pulls, right = ([program.variable(0.0) for _ in range(3)] for _ in range(2))
        tied, resisted = program.variable(0.0), program.variable(1.0)

        def now(parts: list[Any]) -> Vector:
            return parts[0].value, parts[1].value, parts[2].value

        # Outwards: forces and resistances of node after node, of which Thomas's algorithm takes away those before;
        # off the diagonal stands -tie.
        with program.loop(0, self.nodes) as i:
            own, place, speed = self._node(i), self._state.vector(self._place(i)), self.speed(i)
            springs = self._number(i, "slack"), self._number(i, "hold"), self._number(i, "support")
            gripped, inside = room.load(own + _GRIPPED), i < last
            pull, tie = self._edge(i, h)
            pull = xp.where(inside, pull[0], 0.0), xp.where(inside, pull[1], 0.0), xp.where(inside, pull[2], 0.0)
            tie, before = xp.where(inside, tie, 0.0), tied.value
            held = add(times(gripped, speed), hold_force(xp, place, *springs))
            total = add(add(room.vector(own + _PULLED), held), minus(pull, now(pulls)))
            resists = node_resistance(xp, place, *springs, self._number(i, "drag"), gripped, h)
            share = before / resisted.value
            total = add(total, times(share, now(right)))
            resists = resists + tie + before - share * before
            room.put(own + _PULLED, total)
            room.put(own + _DIAGONAL, (resists, tie))
            for parts, values in ((pulls, pull), (right, total), ([tied, resisted], (tie, resists))):
                for part, value in zip(parts, values, strict=True):
                    part.value = value
        beyond = [program.variable(0.0) for _ in range(3)]
        with program.loop(0, self.nodes, backwards=True) as i:
            own, slot = self._node(i), self._place(i)
            total = add(room.vector(own + _PULLED), times(room.load(own + _TIE), now(beyond)))
            moving = times(1 / room.load(own + _DIAGONAL), total)
            for part, value in zip(beyond, moving, strict=True):
                part.value = value
                fastest.value = xp.where(xp.abs(value) < limit, fastest.value, xp.abs(value))
            self._state.put(slot, (*add(self._state.vector(slot), times(h, moving)), *moving))

    def _edge(self, i: Value, h: float) -> tuple[Vector, Value]:
        """Force with which an edge pulls the node before it, and what ties both; of no meaning behind the last node."""
        xp, room, own = self.program.xp, self._room, self._node(i)
        unit, length, rest = room.vector(own + _UNIT), room.load(own + _LENGTH), self._number(i, "length")
        stiffness, bending = self._number(i, "tension"), (self._number(i, "bending"), self._number(i + 1, "bending"))
        tension = edge_tension(xp, length, rest, stiffness, self._of_world("pleating"))
        pull = minus(times(tension, unit), unit_rate(unit, length, room.vector(own + _OVER)))
        return pull, edge_resistance(xp, stiffness, bending[0], bending[1], rest, h)

    def _bend(self) -> None:
        """What bending and turned cross-sections do to the edges' directions."""
        program, xp, room = self.program, self.program.xp, self._room
        with program.loop(0, self.nodes) as i:
            room.put(self._node(i) + _OVER, [0.0] * 3)
        with program.loop(0, self.nodes) as i:
            own, (inner, here, before) = self._node(i), self._edges(i)
            first = own + _COUPLES
            rows = room.vector(first), room.vector(first + 3), room.vector(first + 6)
            turn = room.load(own + _COSINE), room.vector(own + _TURN)
            work = turn_gradient(xp, self._vector(i, "tangent"), *turn, rows)
            work = unit_rate(room.vector(own + _TANGENT), room.load(own + _SUM), work)
            change = minus(room.vector(here + _UNIT), room.vector(before + _UNIT))
            bend = times(inner, bend_gradient(xp, change, self._number(i, "turn"), self._number(i, "bending")))
            room.put(here + _OVER, add(room.vector(here + _OVER), minus(work, bend)))
            more = times(inner, add(work, bend))
            room.put(before + _OVER, add(room.vector(before + _OVER), more))

    def tensions(self, node: Value, radius: Value) -> tuple[Value, Value]:
        """Tensions of the wall along the colon behind a node, and of its mesentery [N/m] (`axis_tensions`).

        Args:
            node: which.
            radius: of the lumen there [m].
        """
        xp, room, place = self.program.xp, self._room, self._state.vector(self._place(node))
        names = "length", "tension", "slack", "hold", "support"
        rest, tension, slack, hold, support = (self._number(node, name) for name in names)
        lengths = room.load(self._node(node) + _LENGTH), rest
        along = axial_tension(xp, *lengths, tension, self._of_world("pleating"), radius)
        held = mesentery_tension(xp, place, slack, hold, support, self._of_world("spacing"))
        return xp.where(node < self.nodes - 1, along, 0.0), held

    def speed(self, node: Value) -> Vector:
        """Velocity of a node [m/s]."""
        return self._state.vector(self._place(node) + 3)

    def _now(self, node: Value) -> Vector:
        return add(self._vector(node, "place"), self._state.vector(self._place(node)))

    def _edges(self, node: Value) -> tuple[Value, Value, Value]:
        """1 for nodes between two edges and 0 for ends, and the rooms of the edges after and before."""
        where, last = self.program.xp.where, self.nodes - 1
        inner = (node > 0) & (node < last)
        after = where(node < last, node, last - 1)
        return where(inner, 1.0, 0.0), self._node(after), self._node(where(node > 0, node - 1, 0))

    def _cell(self, arc: Value) -> Cell:
        return Cell(*node_cell(self.program.xp, self._of_world("spacing"), self.nodes, arc))

    def _turns(self, cell: Cell) -> tuple[tuple[Value, Vector], tuple[Value, Vector]]:
        first, second = (self._node(cell.at + i) for i in range(2))
        room = self._room
        return (
            (room.gather(first + _COSINE), room.gather_vector(first + _TURN)),
            (room.gather(second + _COSINE), room.gather_vector(second + _TURN)),
        )

    def _axis(self, arc: Value) -> Vector:
        return axis_point(self.program.xp, self._tables, *self._stations, arc)

    def _of_world(self, name: str) -> Value:
        return self._world.load(WORLD.index(name))

    def _number(self, node: Value, name: str) -> Value:
        first = self.program.xp.int32(self._of_world("first_node"))
        return self._rows.read(first + node, AXIS.index(name))

    def _vector(self, node: Value, name: str) -> Vector:
        first, column = self.program.xp.int32(self._of_world("first_node")), AXIS.index(name)
        return tuple(self._rows.read(first + node, column + i) for i in range(3))  # type: ignore[return-value]

    def _place(self, node: Value) -> Value:
        return self.layout.axis + node * NODE

    def _node(self, node: Value) -> Value:
        return self.layout.node_room + node * NODE_ROOM
