"""A colon that moves on its mesentery, in programs: the laws of `haustra.models.wall.moving_colon`, node by node."""

from collections.abc import Callable
from typing import Any, NamedTuple

from haustra.envs.sim.linear.layout import CELL_ALONE, LOOP_ROOM, NODE, NODE_ROOM, THREAD_ROOM, WORLD, Layout
from haustra.envs.sim.linear.loops import Loops
from haustra.envs.sim.linear.memory import Lanes, Rows
from haustra.envs.sim.linear.press import COUPLES, DAMPED, LEANS, PULLED, SQUARE, PressLists, PressRows, Touch
from haustra.envs.sim.linear.sweep import Before, NodeNumbers, NodeRows, Nodes, along, in_turn, kept_numbers
from haustra.envs.sim.linear.threads import Threads
from haustra.envs.sim.linear.trace import Changing, Program, Value
from haustra.models.injury.pain import axial_tension, mesentery_tension
from haustra.models.wall.lumen_table import Tables, axis_point
from haustra.models.wall.moving_colon import (
    POSE,
    bend_stiffness,
    edge_resistance,
    edge_tension,
    gas_thrust,
    hold_force,
    lean_resistance,
    node_cell,
    node_resistance,
    node_turn_resistance,
    packed_bend,
    packed_resistance,
    wall_bend,
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
    held_at,
    node_closing,
    node_closing_rate,
    section_gradient,
    taken_back,
    touched,
    turned,
    twist,
    twisted,
)
from haustra.models.wall.surroundings import SIDES, breath, envelope_force
from haustra.models.wall.vectors import Vector, add, between, cross, dot, minus, norm, times, unit_rate

_CLOSING, _LENGTH, _SECTION, _SPIN, _FLAT_RATE, _ACROSS_RATE = 0, 3, 4, 12, 15, 16
"""What each node's room holds, and the cell behind it."""
_PRESSED = 19
"""Where, behind that, it has the first of the spheres that press in its cell."""
_MOVING, _SPINNING = 0, 4
"""Velocity of a node while those behind it are not known, and its share of theirs; the same of the turn. They take the
place of `_SPIN` and what is behind it."""
_PLACE, _SPEED = 20, 24
"""Where rows that spheres look up have the node's displacement and velocity too."""
_TURN, _TURNING = 3, POSE + 3
"""How a node's section is turned, and its angular velocity about the axis, in its state."""


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
        state, self._world, room = arrays
        apart = (NODE, NODE_ROOM, LOOP_ROOM, THREAD_ROOM) if layout.abreast == 1 else (1, 1, 1, 1)
        self._state = NodeNumbers(state, layout.node_state, apart[0])
        self._room, self._rows_of_cells = room, layout.abreast > 1
        self._cells: Any = NodeNumbers(room, layout.node_slot, apart[1])
        self._moving = NodeNumbers(room, lambda number: layout.node_slot(_SPIN + number), apart[1])
        self._pressed: PressRows | PressLists
        if self._rows_of_cells:
            self._cells = NodeRows(room, layout.cell_room + layout.abreast * CELL_ALONE, CELL_ALONE // 4)
            self._moving = NodeNumbers(room, layout.node_slot, 1)
            self._pressed = PressRows(program, layout, room)
        else:
            heads = NodeNumbers(room, lambda number: layout.node_slot(_PRESSED + number), apart[1])
            kept = NodeNumbers(room, lambda number: layout.node_slot(_SECTION + number), apart[1])
            self._pressed = PressLists(program, layout, (state, room), (heads, kept), self._cell)
        self._rows, self._first_row = rows, {}
        self._time = lambda: state.load(layout.time)
        self._tables, self._stations = tables
        looping = NodeNumbers(room, layout.loop_slot, apart[2])
        self.loops = Loops(program, layout, looping, self._now, self._row) if layout.touching else None
        drawn = NodeNumbers(room, layout.thread_slot, apart[3])
        self.threads = Threads(program, layout, drawn, self._now, self._row)

    def shape(self, reached: Value) -> Value:
        """Find how the axes lie and their sections go along, and let nothing press on them.

        Args:
            reached: arc length up to which something may touch them [m].

        Returns:
            The node from which on none was looked at, since nothing reaches there.
        """
        program, xp, room = self.program, self.program.xp, self._cells
        beyond, first = program.most(self._cell(reached).at) + 2, self._at(0)
        start = self._now(first), self._state.vector(first, POSE)
        with program.side_by_side(self.layout.abreast):
            at_node, edges = Before(program, *start[0], *start[1]), Before(program, *[0.0] * 6, 1.0, 0.0)
            nodes = Before(program, *[0.0] * 3, 1.0, *[0.0] * 9)
            cells = Before(program, *[0.0] * 6)
            with along(program, self.nodes, 1, beyond + 2) as i:
                # Beside the edge before node i, the node and the cell before that edge.
                node, cell = i.back(1), i.back(2)
                self._state.fetch(i.first + 2, 0, NODE)
                place, speed = self._now(i), self._state.vector(i, POSE)
                before = at_node(*place, *speed)
                edge, change = self._edge(i, minus(place, before[:3])), self._edge(i, minus(speed, before[3:]))
                length = norm(xp, edge)
                unit = times(1 / length, edge)
                rate, longer = unit_rate(unit, length, change), dot(unit, change)
                before = edges(*unit, *rate, length, longer)
                stretch = before[6], before[7]
                total, rate = add(unit, before[:3]), add(rate, before[3:6])
                size = norm(xp, total)
                tangent = times(1 / size, total)
                real, part = brought_along(xp, self._turn(node), self._vector(node, "tangent"), tangent)
                spin = cross(tangent, unit_rate(tangent, size, rate))
                spin = add(spin, times(self._state.load(node, _TURNING), tangent))
                moving = cross(spin, tangent)
                before = nodes(*tangent, real, *part, *spin, *moving)
                tangents, turn = (before[:3], tangent), (before[3], before[4:7])
                spin, moving = before[7:10], (before[10:], moving)
                closing = cell_closing(xp, *tangents, stretch[0])
                changing = cell_closing_rate(xp, *tangents, stretch[0], *moving, stretch[1])
                before = cells(*closing, *changing)
                beside = self._beside(cell, before[:3], closing)
                rates = self._beside(cell, before[3:], changing)
                rest, width = turned(*turn, self._vector(cell, "closing")), self._number(cell, "width")
                own = node_closing(*beside, tangents[0])
                flat, across = flattening(xp, own, rest, width)
                changing = node_closing_rate(*beside, tangents[0], *rates, moving[0])
                flat_rate, across_rate = flattening_rate(xp, own, rest, width, changing, cross(spin, rest))
                section = turn[0], *turn[1], flat, *across
                room.put(cell, _CLOSING, (*closing, stretch[0], *section, *spin, flat_rate, *across_rate))
                if self._rows_of_cells:
                    room.put(cell, _PLACE, (*self._state.vector(cell, 0), 0.0, *self._state.vector(cell, POSE)))
                self._pressed.clear(cell)
        return beyond

    def reference(self, place: Vector, arc: Value) -> Vector:
        """Where a place near an arc length stands in the colon at rest."""
        xp, cell = self.program.xp, self._cell(arc)
        axis, moved = self._axis(arc), between(*self._looked_up(cell, 0, _PLACE), cell.share)
        along = self._row_vector(cell.at, "tangent"), self._row_vector(cell.at + 1, "tangent")
        length = self._row(cell.at, "length")
        closings = cell_closing(xp, *along, length), self._cells.gather_vector(cell.at, _CLOSING)
        stretch = self._cells.gather(cell.at, _LENGTH) / length
        offset = minus(minus(place, axis), moved)
        return add(axis, taken_back(xp, offset, stretch, along, closings, *self._sections(cell), cell.share))

    def moved(self, arc: Value) -> Vector:
        """How far the axis has moved from rest at an arc length [m]."""
        cell = self._cell(arc)
        before, after = (self._state.gather_vector(cell.at + i, 0) for i in range(2))
        return between(before, after, cell.share)

    def lying(self, node: Value) -> list[Value | float]:
        """How the axis lies at a node that all worlds share, as `haustra.envs.sim.linear.cameras.VIEW` has it."""
        xp, room, cell = self.program.xp, self._cells, Cell(node, self.program.constant(0.0))
        place, _ = self._looked_up(cell, 0, _PLACE)
        tangents = self._row_vector(node, "tangent"), self._row_vector(node + 1, "tangent")
        length = self._row(node, "length")
        (real, part, flat, across), _ = self._sections(cell)
        closings = cell_closing(xp, *tangents, length), room.gather_vector(node, _CLOSING)
        stretch = room.gather(node, _LENGTH) / length
        found = *place, stretch, *closings[1], flat, real, *part, *across, 0.0, *closings[0], 0.0, *tangents[0], 0.0
        return list(found)

    def _looked_up(self, cell: Cell, number: int, row: int) -> tuple[Vector, Vector]:
        """Three numbers of the states of the nodes beside a place, or of rows, where spheres look them up."""
        found = (self._cells, row) if self._rows_of_cells else (self._state, number)
        before, after = (found[0].gather_vector(cell.at + i, found[1]) for i in range(2))
        return before, after

    def most_depth(self, arc: Value, depth: Value, radius: Value) -> Value:
        """A bound of the depth of a sphere in the wall as it is now, given that at rest [m], as `touched` finds it."""
        xp, cell = self.program.xp, self._cell(arc)
        flat = xp.maximum(*(self._cells.gather(cell.at + end, _SECTION + 4) for end in range(2)))
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
        xp, cell, room = self.program.xp, self._cell(arc), self._cells
        before, after = self._sections(cell)
        depth, normal, surface = touched(xp, depth, normal, radius, before, after, cell.share)
        along = self._row_vector(cell.at, "tangent"), self._row_vector(cell.at + 1, "tangent")
        held = held_at(minus(rest, self._axis(arc)), surface, along, cell.share)

        def speed(node: Value, section: Section, moving: Vector) -> Vector:
            rates = room.gather_vector(node, _SPIN), room.gather(node, _FLAT_RATE)
            return add(moving, carried_rate(section, (*rates, room.gather_vector(node, _ACROSS_RATE)), held))

        first, last = self._looked_up(cell, POSE, _SPEED)
        return depth, normal, held, between(speed(cell.at, before, first), speed(cell.at + 1, after, last), cell.share)

    def press(self, arc: Value, sphere: Value, touch: Touch) -> None:
        """Let a sphere press on the wall, or those that stand side by side from that one on, at arc lengths [m]."""
        self._pressed.add(self._cell(arc), sphere, touch)

    def meet(self, place: Vector, arc: Value, feel: Callable[[Vector, Vector], None]) -> None:
        """Let the shaft up to its next sphere draw on the nodes that it has missed (`Threads.meet`)."""
        self.threads.meet(place, arc, self._of_world("spacing"), feel)

    def step(self, h: float, fastest: Any, bounds: tuple[float, Value], beyond: Value) -> None:
        """Find how fast the axes give way in a time step, which `take_over` then lets them.

        Args:
            h: time step [s].
            fastest: keeps what is faster than a limit.
            bounds: the limit of speeds [m/s, rad/s], and which worlds go on.
            beyond: from which node on nothing presses (`shape`).
        """
        limit, going = bounds
        start = self._now(self._at(0))
        if self.loops:
            self.loops.press()
        with self.program.side_by_side(self.layout.abreast):
            self._outwards(start, h, beyond, going)
            self._back(h, fastest, limit)

    def _outwards(self, start: Vector, h: float, beyond: Value, going: Value) -> None:
        """Forces and resistances of node after node, of which Thomas's algorithm takes away those before."""
        program, xp, by_spheres = self.program, self.program.xp, self._pressed
        last = self.nodes - 1
        places, edges, earlier = (
            Before(program, *start),
            Before(program, *[0.0] * 3, 1.0),
            Before(program, *[0.0] * 3, 1.0),
        )
        turns = Before(program, *[0.0] * 3, 1.0, 1.0, *[0.0] * 3)
        stiff, stiffer = (Before(program, 1.0, 0.0, 0.0, 0.0) for _ in range(2))
        grips, gripping = Before(program, 0.0), Before(program, 0.0)
        closings, works, torques = Before(program, *[0.0] * 3), Before(program, *[0.0] * 4), Before(program, 0.0)
        bends, lower, shortened, pulls = (Before(program, *[0.0] * count) for count in (3, 3, 1, 3))
        opens, openings = Before(program, *[0.0] * 3), Before(program, *[0.0] * 3)
        closes, leant, leaning = Before(program, 0.0), Before(program, 0.0), Before(program, 0.0)
        moved, spun = kept_numbers(program, *[0.0] * 5), kept_numbers(program, *[0.0] * 3)
        around = self._surroundings()
        with along(program, self.nodes, 1, self.nodes + 3) as i:
            node, cell, own = i.back(1), i.back(2), i.back(3)
            self._state.fetch(i.first + 2, 0, POSE)
            self._cells.fetch(i.first + 1, _PRESSED, 1)
            place = self._now(i)
            edge = self._edge(i, minus(place, places(*place)))
            length = norm(xp, edge)
            unit = times(1 / length, edge)
            before = edges(*unit, length)
            unit_before, length_before = before[:3], before[3]
            total = add(unit, unit_before)
            size = norm(xp, total)
            tangent, at_rest = times(1 / size, total), self._vector(node, "tangent")
            inner = (node.each > 0) & (node.each < last)
            bending = self._number(node, "bending")
            change, bent_at_rest, width = (
                minus(unit, unit_before),
                self._number(node, "turn"),
                self._number(node, "width"),
            )
            both = length + length_before, self._number(node, "length") + self._number(cell, "length")
            bent = wall_bend(xp, *both, change, bent_at_rest, bending)
            packed = packed_bend(xp, *both, change, bent_at_rest, bending, width)
            bend = self._where(inner, add(bent.gradient, packed.gradient))
            stiffness = bend_stiffness(xp, bending, size)
            packed = [
                xp.where(inner, part, 0.0) for part in (bent.tension + packed.tension, packed.stiffness, packed.along)
            ]
            # How the node's section is turned, what holds it from turning, and what presses on it.
            old = self._turn(node)
            turn = brought_along(xp, old, at_rest, tangent)
            inside = node.each <= last
            kept = xp.where(inside, turn[0], old[0]), *self._where(inside, turn[1], old[1])
            self._state.put(node, _TURN, [xp.where(going, *pair) for pair in zip(kept, (old[0], *old[1]), strict=True)])
            upright = self._number(node, "upright")
            stiffness = stiffness + upright
            tilt, lean = twist(xp, STILL, turn, (at_rest, tangent), STILL)
            righting = xp.where(inside, upright * tilt, 0.0)
            work, torque = times(-righting, lean), -righting
            gripped = by_spheres.grip(node, beyond)
            pressed = Changing(program, [0.0] * 13)
            with program.when(gripped > 0):
                pressed.now = self._press_section(node, gripped > 0, turn, tangent)
            work, torque = add(work, pressed.now[:3]), torque + pressed.now[3]
            over_cell = add(closings(*pressed.now[7:10]), pressed.now[4:7])
            leans, closed, closed_behind = pressed.now[10:]
            closed = closes(closed_behind)[0] + closed
            # The edge before it, and the cell there.
            before = turns(*tangent, size, kept[0], *kept[1:])
            tangents, size, turn_before = (before[:3], tangent), before[3], (before[4], before[5:])
            own_stiffness = self._number(node, "torsion"), stiffness
            rest, tension, torsion, stiffness = stiff(
                self._number(node, "length"), self._number(node, "tension"), *own_stiffness
            )
            sine, binormal = twist(xp, turn_before, turn, tangents, self._way(cell))
            moment = xp.where(inside, torsion * sine, 0.0)
            twisting = times(moment, binormal)
            (gripped_before,) = grips(gripped)
            bent = Changing(program, [0.0] * 8)
            with program.when(gripped + gripped_before > 0):
                first, later, shortening = cell_closing_gradient(xp, *tangents, length_before, over_cell)
                reach = cell_closing_reach(xp, *tangents, length_before)
                bent.now = *first, *later, shortening, 2 * closed * reach * reach
            before = works(*add(minus(work, twisting), bent.now[3:6]), torque - moment)
            work, torque = add(minus(before[:3], twisting), bent.now[:3]), before[3] + moment
            # What that does to the node before the edge, whose work is done, and so to the edge before that.
            work, bend = unit_rate(tangents[0], size, work), bends(*bend)
            leans = lean_resistance(leant(leans + bent.now[7])[0] + bent.now[7], size)
            leans = leaning(leans)[0] + leans
            over = add(lower(*minus(work, bend)), add(work, bend))
            before = earlier(*unit_before, length_before)
            unit, length = before[:3], before[3]
            (shortening,) = shortened(bent.now[6])
            opened, *packed_after = opens(*packed)
            opened_before, *packed_before = openings(opened, *packed_after)
            rest, tension, torsion, stiffness_before = stiffer(rest, tension, torsion, stiffness)
            pull = edge_tension(xp, length, rest, tension, self._of_world("pleating")) + opened + opened_before
            drags = self._number(own, "drag"), self._number(own, "turn_drag")
            pull = pull + gas_thrust(xp, self._of_world("pressure_lost"), *drags, tension)
            pull = pull - shortening
            pull = minus(times(pull, unit), unit_rate(unit, length, over))
            inside = (own.each >= 0) & (own.each < last)
            tie, surplus = edge_resistance(xp, length, rest, tension, stiffness_before, stiffness, h)
            tie = tie + packed_resistance(xp, length, tuple(packed_before), tuple(packed_after), h)
            leans, slowed = leans / (length * length), Changing(program, [0.0] * 3)
            with program.when(leans + surplus > 0):
                apart = minus(self._state.vector(own.back(-1), POSE), self._state.vector(own, POSE))
                slowed.now = add(times(leans, apart), times(surplus * dot(unit, apart), unit))
            pull = self._where(inside, add(pull, slowed.now))
            tie = xp.where(inside, tie + leans, 0.0)
            # The node before that one, which all forces of are known now.
            (gripped,), (torque,) = gripping(gripped_before), torques(torque)
            held = Changing(program, [0.0] * 5)
            with program.when(gripped > 0):
                speed = self._state.vector(own, POSE)
                pulled = (by_spheres.before(own, PULLED + i) for i in range(3))
                pushed: Any = tuple(xp.where(gripped > 0, each, 0.0) for each in pulled)
                resisted = xp.where(gripped > 0, by_spheres.before(own, SQUARE), 0.0)
                held.now = *add(pushed, times(gripped, speed)), resisted, resisted * self._state.load(own, _TURNING)
            place, drag = self._state.vector(own, 0), self._number(own, "drag")
            springs = self._number(own, "slack"), self._number(own, "hold"), self._number(own, "support")
            force = add(held.now[:3], self._vector(own, "load"))
            if around:
                place, pressed, stiffness = around(own, place)
                force, gripped = add(force, pressed), gripped + h * stiffness
            if self.loops:
                pressed, stiffness = self.loops.of(own)
                force, gripped = add(force, pressed), gripped + h * stiffness
            pressed, stiffness = self.threads.of(own)
            force, gripped = add(force, pressed), gripped + h * stiffness
            place = self._from_root(own, place)
            force = add(force, hold_force(xp, place, *springs))
            force = add(force, minus(pull, pulls(*pull)))
            resists = node_resistance(xp, place, *springs, drag, gripped, h)
            found = in_turn(program, _eliminated, moved, (resists, tie, *force))
            self._moving.put(own, _MOVING, found)
            turns_by = self._number(own, "upright"), self._number(own, "turn_drag")
            resists = node_turn_resistance(*turns_by, held.now[3], h)
            tie = xp.where(inside, h * torsion, 0.0)
            found = in_turn(program, _eliminated, spun, (resists, tie, torque + held.now[4]))
            self._moving.put(own, _SPINNING, found)

    def _back(self, h: float, fastest: Any, limit: float) -> None:
        """Velocities of node before node."""
        program, xp = self.program, self.program.xp
        beyond, worst, square = kept_numbers(program, *[0.0] * 4), program.variable(0.0), program.variable(0.0)
        with along(program, self.nodes, 0, self.nodes, backwards=True) as i:
            self._moving.fetch(i.first - 3, _MOVING, 6)
            shares = self._moving.load(i, _MOVING), self._moving.load(i, _SPINNING)
            alone = self._moving.vector(i, _MOVING + 1), self._moving.load(i, _SPINNING + 1)
            given = shares[0], *alone[0], shares[1], alone[1]
            speed = in_turn(program, _followed, beyond, given, backwards=True)
            for value in speed:
                size = xp.where(i.each < self.nodes, xp.abs(value), 0.0)
                worst.value = xp.where(size < limit, worst.value, size)
            if self.loops:
                square.value = xp.maximum(xp.where(i.each < self.nodes, dot(speed, speed), 0.0), square.value)
            self._moving.put(i, _MOVING, speed)
        if self.loops:
            self.loops.moved(square.value, h)
        for value in program.apart(worst.value):
            fastest.value = xp.where(value < limit, fastest.value, value)

    def take_over(self, h: float, going: Callable[[], Value]) -> None:
        """Let nodes be as fast as was found, and go there, in worlds that go on."""
        program = self.program
        with program.side_by_side(self.layout.abreast), along(program, self.nodes, 0, self.nodes) as i:
            self._state.fetch(i.first + 3, 0, NODE)
            self._moving.fetch(i.first + 3, _MOVING, 4)
            speed = *self._moving.vector(i, _MOVING), self._moving.load(i, _MOVING + 3)
            turn = self._turn(i)
            turn = twisted(turn, turned(*turn, self._vector(i, "tangent")), h * speed[3])
            place = add(self._state.vector(i, 0), times(h, speed[:3]))
            for number, value in enumerate((*place, turn[0], *turn[1], *speed)):
                self._state.put(i, number, (program.xp.where(going(), value, self._state.load(i, number)),))

    def _press_section(self, node: Nodes, pressed: Value, turn: Turn, tangent: Vector) -> tuple[Any, ...]:
        """What forces on the wall about a node do to its section: work, torque and gradients over the cells beside it.

        Then what resists changes of its leaning, and of how far both cells close. Of the ends' two cells the one that
        there is has both.
        """
        xp, found, room, last = self.program.xp, self._pressed, self._cells, self.nodes - 1
        parts = [xp.where(pressed, found.now(node, COUPLES + part), 0.0) for part in range(9)]
        x, y, z = ((parts[row], parts[row + 1], parts[row + 2]) for row in (0, 3, 6))
        cells = self._beside(node, room.vector(node.back(1), _CLOSING), room.vector(node, _CLOSING))
        section = *turn, room.load(node, _SECTION + 4), room.vector(node, _SECTION + 5)
        closed = self._vector(node, "closing"), self._number(node, "width")
        work, torque, before, after = section_gradient(xp, section, tangent, cells, *closed, (x, y, z))
        now, rest = node_closing(*cells, tangent), turned(*turn, closed[0])
        reach = flattening_reach(xp, now, rest, closed[1])
        closes = found.now(node, DAMPED) * reach * reach
        leaning, closes = (xp.where(pressed, each, 0.0) for each in (found.now(node, LEANS), closes))
        both, first, end = add(before, after), node.each > 0, node.each < last
        before, after = self._where(first, before), self._where(end, after)
        before, after = self._where(end, before, both), self._where(first, after, both)
        sides = (xp.where(own, xp.where(other, 1.0, 2.0), 0.0) * closes for own, other in ((first, end), (end, first)))
        return *work, torque, *before, *after, leaning, *sides

    def tensions(self, node: Value, radius: Value) -> tuple[Value, Value]:
        """Tensions of the wall along the colon behind a node, and of its mesentery [N/m] (`axis_tensions`).

        Args:
            node: which.
            radius: of the lumen there [m].
        """
        xp, at = self.program.xp, self._at(node)
        place, names = self._state.vector(at, 0), ("length", "tension", "slack", "hold", "support")
        rest, tension, slack, hold, support = (self._number(at, name) for name in names)
        if around := self._surroundings():
            place = around(at, place)[0]
        place = self._from_root(at, place)
        lengths = norm(xp, minus(self._now(at.back(-1)), self._now(at))), rest
        along = axial_tension(xp, *lengths, tension, self._of_world("pleating"), radius)
        support = 0.0 if self.layout.rooted else support
        held = mesentery_tension(xp, place, slack, hold, support, self._of_world("spacing"))
        return xp.where(node < self.nodes - 1, along, 0.0), held

    def _from_root(self, at: Nodes, place: Vector) -> Vector:
        """How far a node is from what it hangs on, given how far from where that had it at rest [m]."""
        return add(place, self._vector(at, "root")) if self.layout.rooted else place

    def _surroundings(self) -> Callable[[Nodes, Vector], tuple[Vector, Vector, Value]] | None:
        """What says of nodes how far they are from what they hang on, what the envelope does, and how stiffly."""
        if not self.layout.surrounded:
            return None
        xp, first = self.program.xp, self.program.index(0)
        left, back, head = (self._row_vector(first, name) for name in ("left", "back", "head"))
        front, firm, dome = (self._row(first, name) for name in ("front", "firm", "dome"))
        drawn = breath(xp, self._row(first, "breaths"), self._time())
        start = self.layout.columns.index("room")

        def around(at: Nodes, place: Vector) -> tuple[Vector, Vector, Value]:
            room = tuple(self._read(at.within, start + side) for side in range(len(SIDES)))
            force, stiffness = envelope_force(xp, place, (left, back, head), room, (front, firm), drawn * dome)
            return add(place, times(drawn * self._number(at, "sway"), head)), force, stiffness

        return around

    def _at(self, node: Any) -> Nodes:
        return Nodes.at(self.program, self.program.index(node), self.nodes)

    def _now(self, at: Nodes) -> Vector:
        return add(self._vector(at, "place"), self._state.vector(at, 0))

    def _edge(self, end: Nodes, change: Vector) -> Vector:
        """What changes along the edge before a node; nothing does behind the last."""
        return self._where(end.each < self.nodes, change)

    def _beside(self, node: Nodes, before: Vector, after: Vector) -> tuple[Vector, Vector]:
        """What there is in the cells before and after a node; at the ends that of the one there is, twice."""
        return self._where(node.each > 0, before, after), self._where(node.each < self.nodes - 1, after, before)

    def _where(self, condition: Value, yes: Vector, no: Vector = (0.0, 0.0, 0.0)) -> Vector:
        where = self.program.xp.where
        return where(condition, yes[0], no[0]), where(condition, yes[1], no[1]), where(condition, yes[2], no[2])

    def _cell(self, arc: Value) -> Cell:
        return Cell(*node_cell(self.program.xp, self._of_world("spacing"), self.nodes, arc))

    def _turn(self, at: Nodes) -> Turn:
        return self._state.load(at, _TURN), self._state.vector(at, _TURN + 1)

    def _way(self, at: Nodes) -> Turn:
        """Brings the direction at rest of a node to that of the next."""
        column = self.layout.columns.index("way")
        x, y, z = (self._read(at.within, column + 1 + i) for i in range(3))
        return self._read(at.within, column), (x, y, z)

    def _sections(self, cell: Cell) -> tuple[Section, Section]:
        """Cross-sections at the nodes before and after a place; lanes may be in different cells."""

        def section(node: Value) -> Section:
            numbers = [self._cells.gather(node, _SECTION + i) for i in range(8)]
            return numbers[0], (numbers[1], numbers[2], numbers[3]), numbers[4], (numbers[5], numbers[6], numbers[7])

        return section(cell.at), section(cell.at + 1)

    def _axis(self, arc: Value) -> Vector:
        return axis_point(self.program.xp, self._tables, *self._stations, arc)

    def _of_world(self, name: str) -> Value:
        return self._world.load(WORLD.index(name))

    def _number(self, at: Nodes, name: str) -> Value:
        return self._row(at.within, name)

    def _vector(self, at: Nodes, name: str) -> Vector:
        return self._row_vector(at.within, name)

    def _row(self, node: Value, name: str) -> Value:
        return self._read(node, self.layout.columns.index(name))

    def _row_vector(self, node: Value, name: str) -> Vector:
        column = self.layout.columns.index(name)
        return self._read(node, column), self._read(node, column + 1), self._read(node, column + 2)

    def _read(self, node: Value, column: int) -> Value:
        block = self.program.builder.block
        if block not in self._first_row:  # once where it is known to be, so that the same row is known again
            self._first_row = {block: self.program.xp.int32(self._of_world("first_node"))}
        return self._rows.read(self._first_row[block] + node, column)


def _eliminated(kept: Any, given: Any) -> Any:
    """A row of a tridiagonal system without the unknown before: what of the next is in its own, and what else.

    Args:
        kept: off the diagonal before stands - tie; the share of the unknown in the one before, and the rest of that.
        given: what the row resists by itself, its own tie, and its right side, of one number or more.
    """
    (tie_before, share, *alone), (resists, tie, *right) = kept, given
    inverse = 1 / (resists + tie + tie_before - share * tie_before)
    found = tuple((force + tie_before * before) * inverse for force, before in zip(right, alone, strict=True))
    share = tie * inverse
    return (tie, share, *found), (share, *found)


def _followed(beyond: Any, given: Any) -> Any:
    """Unknowns from those of the next row (`_eliminated`)."""
    *next_move, next_spin = beyond
    share, x, y, z, spin_share, spin = given
    moving = (own + share * after for own, after in zip((x, y, z), next_move, strict=True))
    found = *moving, spin + spin_share * next_spin
    return found, found
