"""A colon that moves on its mesentery, in programs: the laws of `haustra.models.wall.moving_colon`, node by node."""

from typing import Any, NamedTuple

from haustra.envs.sim.linear.layout import AXIS, NODE, NODE_ROOM, WORLD, Layout
from haustra.envs.sim.linear.memory import Lanes, Rows
from haustra.envs.sim.linear.trace import Program, Value
from haustra.models.injury.pain import axial_tension, mesentery_tension
from haustra.models.wall.lumen_table import Tables, axis_point
from haustra.models.wall.moving_colon import (
    POSE,
    bend_gradient,
    edge_resistance,
    edge_tension,
    grip_resistance,
    hold_force,
    lean_grip,
    lean_resistance,
    node_cell,
    node_resistance,
    node_turn_resistance,
)
from haustra.models.wall.sections import (
    STILL,
    Section,
    Turn,
    brought_along,
    carried_rate,
    cell_closing,
    cell_closing_gradient,
    cell_closing_rate,
    cell_closing_reach,
    flattening,
    flattening_rate,
    flattening_reach,
    node_closing,
    node_closing_rate,
    section_gradient,
    taken_back,
    touched,
    turned,
    twist,
    twisted,
)
from haustra.models.wall.vectors import Vector, add, between, cross, dot, minus, norm, times, unit_rate

_UNIT, _LENGTH, _TANGENT, _SUM, _TURN, _CLOSING, _FLAT, _ACROSS = 0, 3, 4, 7, 8, 12, 15, 16
_SPIN, _FLAT_RATE, _ACROSS_RATE = 19, 22, 23
_COUPLES, _PULLED, _GRIPPED, _DIAGONAL, _TIE, _OVER = 26, 35, 38, 42, 43, 44
"""What each node's room holds, and the edge behind it."""
_WORK, _OVER_CELL, _TORQUE, _TURN_RESISTS = _SPIN, _FLAT_RATE, _ACROSS_RATE + 2, _FLAT
_LEANS, _REACH = _DIAGONAL, _TIE
"""What a step puts in the place of what is not needed any more."""


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

    def shape(self, reached: Value) -> None:
        """Find how the axes lie and their sections go along, and let nothing press on them.

        How sections flatten is found up to the arc length that is reached by what may touch them [m].
        """
        program, xp, room = self.program, self.program.xp, self._room
        last = self.nodes - 1
        beyond = program.most(self._cell(reached).at) + 2
        with program.loop(0, last) as i:
            edge = minus(self._now(i + 1), self._now(i))
            length = norm(xp, edge)
            unit = times(1 / length, edge)
            rate = unit_rate(unit, length, minus(self.speed(i + 1), self.speed(i)))
            room.put(self._node(i) + _UNIT, (*unit, length))
            room.put(self._node(i) + _OVER, rate)
        with program.loop(0, self.nodes) as i:
            inner, here, before = self._edges(i)
            total, rate = (
                add(room.vector(here + slot), times(inner, room.vector(before + slot))) for slot in (_UNIT, _OVER)
            )
            size, state = norm(xp, total), self._place(i)
            tangent = times(1 / size, total)
            kept = self._state.load(state + 3), self._state.vector(state + 4)
            real, part = brought_along(xp, kept, self._vector(i, "tangent"), tangent)
            room.put(self._node(i) + _TANGENT, (*tangent, size, real, *part))
            spin = cross(tangent, unit_rate(tangent, size, rate))
            room.put(self._node(i) + _SPIN, add(spin, times(self._state.load(state + POSE + 3), tangent)))
        with program.loop(0, xp.where(beyond < last, beyond, last)) as i:
            own, longer = self._node(i), minus(self.speed(i + 1), self.speed(i))
            now, length = (self._tangent(i), self._tangent(i + 1)), room.load(own + _LENGTH)
            before, after = (cross(room.vector(self._node(i + end) + _SPIN), now[end]) for end in range(2))
            room.put(own + _CLOSING, cell_closing(xp, *now, length))
            longer = dot(room.vector(own + _UNIT), longer)
            room.put(own + _OVER, cell_closing_rate(xp, *now, length, before, after, longer))
        with program.loop(0, self.nodes) as i:
            room.put(self._node(i) + _COUPLES, [0.0] * 16)
        with program.loop(0, beyond) as i:
            own, (_, here, before) = self._node(i), self._edges(i)
            tangent, spin = self._tangent(i), room.vector(own + _SPIN)
            cells = room.vector(before + _CLOSING), room.vector(here + _CLOSING)
            rates = room.vector(before + _OVER), room.vector(here + _OVER)
            closing = node_closing(*cells, tangent)
            rest, width = turned(*self._turn(own), self._vector(i, "closing")), self._number(i, "width")
            flat, across = flattening(xp, closing, rest, width)
            room.put(own + _FLAT, (flat, *across))
            changing = node_closing_rate(*cells, tangent, *rates, cross(spin, tangent))
            flat_rate, across_rate = flattening_rate(xp, closing, rest, width, changing, cross(spin, rest))
            room.put(own + _FLAT_RATE, (flat_rate, *across_rate))

    def reference(self, place: Vector, arc: Value) -> Vector:
        """Where a place near an arc length stands in the colon at rest."""
        xp, cell = self.program.xp, self._cell(arc)
        axis, moved = self._axis(arc), self.moved(arc)
        along, rest = (self._vector(cell.at, "tangent"), self._vector(cell.at + 1, "tangent")), cell.at
        length, own = self._number(rest, "length"), self._node(cell.at)
        closings = cell_closing(xp, *along, length), self._room.gather_vector(own + _CLOSING)
        stretch = self._room.gather(own + _LENGTH) / length
        offset = minus(minus(place, axis), moved)
        return add(axis, taken_back(xp, offset, stretch, along, closings, *self._sections(cell), cell.share))

    def moved(self, arc: Value) -> Vector:
        """How far the axis has moved from rest at an arc length [m]."""
        cell = self._cell(arc)
        before, after = (self._state.gather_vector(self._place(cell.at + i)) for i in range(2))
        return between(before, after, cell.share)

    def most_depth(self, arc: Value, depth: Value, radius: Value) -> Value:
        """A bound of the depth of a sphere in the wall as it is now, given that at rest [m], as `touched` finds it."""
        xp, cell = self.program.xp, self._cell(arc)
        flat = xp.maximum(*(self._room.gather(self._node(cell.at + end) + _FLAT) for end in range(2)))
        return xp.maximum(depth, (1 - flat) * depth + flat * radius)

    def touched(
        self, arc: Value, rest: Vector, depth: Value, normal: Vector, radius: Value
    ) -> tuple[Value, Vector, Vector, Vector]:
        """Depth of a sphere in the wall as it is now [m], normal, lever of its surface at rest, and the wall's speed.

        Args:
            arc: of the sphere.
            rest: its middle in the colon at rest.
            depth: there.
            normal: of the wall there.
            radius: of the sphere.
        """
        xp, cell = self.program.xp, self._cell(arc)
        before, after = self._sections(cell)
        depth, normal, surface = touched(xp, depth, normal, radius, before, after, cell.share)
        held = minus(add(rest, surface), self._axis(arc))

        def speed(node: Value, section: Section) -> Vector:
            slot = self._node(node)
            rates = self._room.gather_vector(slot + _SPIN), self._room.gather(slot + _FLAT_RATE)
            moving = self._state.gather_vector(self._place(node) + POSE)
            rates = *rates, self._room.gather_vector(slot + _ACROSS_RATE)
            return add(moving, carried_rate(section, rates, held))

        return depth, normal, held, between(speed(cell.at, before), speed(cell.at + 1, after), cell.share)

    def press(self, arc: Value, held: Vector, force: Vector, damper: Value, drag: Value) -> None:
        """Let a force on the wall [N] act, damped by so much along the normal and across it [N s/m].

        Its lever is `held` there.
        """
        cell, pressed = self._cell(arc), grip_resistance(damper)
        resists, square = pressed + drag, dot(held, held)
        leans = lean_grip(self.program.xp, force, pressed, drag)
        for later in range(2):
            slot, part = self._node(cell.at + later), cell.share if later else 1 - cell.share
            shared = times(part, force)
            values = [*(shared[i] * held[j] for i in range(3) for j in range(3)), *shared]
            values += [part * resists, part * resists * square, part * pressed * square, part * leans * square]
            for more, value in enumerate(values):
                self._room.add_at(slot + (_COUPLES + more), value)

    def step(self, h: float, fastest: Any, limit: float) -> None:
        """Let the axes give way for a time step [s]; `fastest` keeps what is faster than a limit."""
        program, xp, room = self.program, self.program.xp, self._room
        self._bend()
        last = self.nodes - 1
        pulls, right = ([program.variable(0.0) for _ in range(3)] for _ in range(2))
        tied, resisted, turn_tied, turn_resisted, torque = (
            program.variable(start) for start in (0.0, 1.0, 0.0, 1.0, 0.0)
        )

        def now(parts: list[Any]) -> Vector:
            return parts[0].value, parts[1].value, parts[2].value

        # Outwards: forces and resistances of node after node, of which Thomas's algorithm takes away those before;
        # off the diagonal stands -tie. Beside it the same for turns about the axis.
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
            gripped, before = room.load(own + _GRIPPED + 1), turn_tied.value
            turns = self._number(i, "upright"), self._number(i, "turn_drag")
            share, tie = before / turn_resisted.value, xp.where(inside, h * self._number(i, "torsion"), 0.0)
            spin = self._state.load(self._place(i) + POSE + 3)
            torque.value = room.load(own + _TORQUE) + gripped * spin + share * torque.value
            turn_resisted.value = node_turn_resistance(*turns, gripped, h) + tie + before - share * before
            turn_tied.value = tie
            room.store(own + _TORQUE, torque.value)
            room.store(own + _TURN_RESISTS, turn_resisted.value)
        beyond, spun = [program.variable(0.0) for _ in range(3)], program.variable(0.0)
        with program.loop(0, self.nodes, backwards=True) as i:
            own, slot = self._node(i), self._place(i)
            total = add(room.vector(own + _PULLED), times(room.load(own + _TIE), now(beyond)))
            moving = times(1 / room.load(own + _DIAGONAL), total)
            tie = xp.where(i < last, h * self._number(i, "torsion"), 0.0)
            spun.value = (room.load(own + _TORQUE) + tie * spun.value) / room.load(own + _TURN_RESISTS)
            for part, value in zip([*beyond, spun], (*moving, spun.value), strict=True):
                part.value = value
                fastest.value = xp.where(xp.abs(value) < limit, fastest.value, xp.abs(value))
            real, part = twisted(self._turn(own), room.vector(own + _TANGENT), h * spun.value)
            place = add(self._state.vector(slot), times(h, moving))
            self._state.put(slot, (*place, real, *part, *moving, spun.value))

    def _edge(self, i: Value, h: float) -> tuple[Vector, Value]:
        """Force with which an edge pulls the node before it, and what ties both; of no meaning behind the last node."""
        xp, room, own = self.program.xp, self._room, self._node(i)
        unit, length, rest = room.vector(own + _UNIT), room.load(own + _LENGTH), self._number(i, "length")
        stiffness = self._number(i, "tension")
        before, after = (self._number(node, "bending") + self._number(node, "upright") for node in (i, i + 1))
        tension = edge_tension(xp, length, rest, stiffness, self._of_world("pleating")) - room.load(own + _OVER_CELL)
        pull = minus(times(tension, unit), unit_rate(unit, length, room.vector(own + _OVER)))
        tie, along = edge_resistance(xp, length, rest, stiffness, before, after, h)
        after = xp.where(i < self.nodes - 1, i + 1, i)
        held = (self._leans(own) + self._leans(self._node(after))) / (length * length)
        apart = minus(self.speed(after), self.speed(i))
        kept = add(times(held, apart), times(along * dot(unit, apart), unit))
        return add(pull, kept), tie + held

    def _leans(self, own: Value) -> Value:
        """What changes of the edges' directions meet at a node [N m s]: contacts on sections that lean and flatten."""
        room = self._room
        return lean_resistance(room.load(own + _GRIPPED + 3) + room.load(own + _LEANS), room.load(own + _SUM))

    def _bend(self) -> None:
        """What bending, twisting and carried cross-sections do to the edges' directions and lengths."""
        program, xp, room = self.program, self.program.xp, self._room
        last = self.nodes - 1
        with program.loop(0, self.nodes) as i:
            room.put(self._node(i) + _OVER, [0.0] * 3)
            room.put(self._node(i) + _OVER_CELL, [0.0] * 3)
            room.put(self._node(i) + _LEANS, [0.0] * 2)
        with program.loop(0, self.nodes) as i:
            own, tangent, rest = self._node(i), self._tangent(i), self._vector(i, "tangent")
            tilt, lean = twist(xp, STILL, self._turn(own), (rest, tangent), STILL)
            righting = self._number(i, "upright") * tilt
            room.put(own + _WORK, times(-righting, lean))
            room.store(own + _TORQUE, -righting)
            room.put(own + _PULLED, add(room.vector(own + _PULLED), self._vector(i, "load")))
            with program.when(room.load(own + _GRIPPED) > 0):
                self._press_section(i)
        with program.loop(0, last) as i:
            own, after = self._node(i), self._node(i + 1)
            now, way = (self._tangent(i), self._tangent(i + 1)), self._way(i)
            sine, binormal = twist(xp, self._turn(own), self._turn(after), now, way)
            moment = self._number(i, "torsion") * sine
            for node, sign in ((own, 1.0), (after, -1.0)):
                room.put(node + _WORK, minus(room.vector(node + _WORK), times(moment, binormal)))
                room.store(node + _TORQUE, room.load(node + _TORQUE) + sign * moment)
            with program.when(room.load(own + _GRIPPED) + room.load(after + _GRIPPED) > 0):
                self._press_cell(own, after)
        with program.loop(0, self.nodes) as i:
            own, (inner, here, before) = self._node(i), self._edges(i)
            work = unit_rate(self._tangent(i), room.load(own + _SUM), room.vector(own + _WORK))
            change = minus(room.vector(here + _UNIT), room.vector(before + _UNIT))
            bend = times(inner, bend_gradient(xp, change, self._number(i, "turn"), self._number(i, "bending")))
            room.put(here + _OVER, add(room.vector(here + _OVER), minus(work, bend)))
            more = times(inner, add(work, bend))
            room.put(before + _OVER, add(room.vector(before + _OVER), more))

    def _press_section(self, i: Value) -> None:
        """What forces on the wall about a node do to its section."""
        room, own, (_, here, before) = self._room, self._node(i), self._edges(i)
        first, tangent = own + _COUPLES, self._tangent(i)
        rows = room.vector(first), room.vector(first + 3), room.vector(first + 6)
        cells = room.vector(before + _CLOSING), room.vector(here + _CLOSING)
        closed = self._vector(i, "closing"), self._number(i, "width")
        found = section_gradient(self.program.xp, self._section(own), tangent, cells, *closed, rows)
        work, torque, over, over_next = found
        for cell, more in ((before, over), (here, over_next)):
            room.put(cell + _OVER_CELL, add(room.vector(cell + _OVER_CELL), more))
        room.put(own + _WORK, add(room.vector(own + _WORK), work))
        room.store(own + _TORQUE, room.load(own + _TORQUE) + torque)
        closing = node_closing(*cells, tangent), turned(*self._turn(own), closed[0]), closed[1]
        reach = flattening_reach(self.program.xp, *closing)
        for cell in (before, here):
            room.store(cell + _REACH, room.load(cell + _REACH) + room.load(own + _GRIPPED + 2) * reach * reach)

    def _press_cell(self, own: Value, after: Value) -> None:
        """What they do to the bend between two nodes."""
        xp, room = self.program.xp, self._room
        now = room.vector(own + _TANGENT), room.vector(after + _TANGENT)
        over, length = room.vector(own + _OVER_CELL), room.load(own + _LENGTH)
        first, later, shortening = cell_closing_gradient(xp, *now, length, over)
        room.store(own + _OVER_CELL, shortening)
        reach = cell_closing_reach(xp, *now, length)
        leans = 2 * room.load(own + _REACH) * reach * reach
        for node, more in ((own, first), (after, later)):
            room.put(node + _WORK, add(room.vector(node + _WORK), more))
            room.store(node + _LEANS, room.load(node + _LEANS) + leans)

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
        return self._state.vector(self._place(node) + POSE)

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

    def _tangent(self, node: Value) -> Vector:
        return self._room.vector(self._node(node) + _TANGENT)

    def _turn(self, own: Value) -> Turn:
        return self._room.load(own + _TURN), self._room.vector(own + _TURN + 1)

    def _way(self, node: Value) -> Turn:
        """Brings the direction at rest of a node to that of the next."""
        first, column = self.program.xp.int32(self._of_world("first_node")), AXIS.index("way")
        x, y, z = (self._rows.read(first + node, column + 1 + i) for i in range(3))
        return self._rows.read(first + node, column), (x, y, z)

    def _section(self, own: Value) -> Section:
        return *self._turn(own), self._room.load(own + _FLAT), self._room.vector(own + _ACROSS)

    def _sections(self, cell: Cell) -> tuple[Section, Section]:
        """Cross-sections at the nodes before and after a place; lanes may be in different cells."""
        room, (first, second) = self._room, (self._node(cell.at + i) for i in range(2))
        return (
            (room.gather(first + _TURN), room.gather_vector(first + _TURN + 1), room.gather(first + _FLAT),
             room.gather_vector(first + _ACROSS)),
            (room.gather(second + _TURN), room.gather_vector(second + _TURN + 1), room.gather(second + _FLAT),
             room.gather_vector(second + _ACROSS)),
        )  # fmt: skip

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
