"""What spheres do to the nodes of a colon that moves, in programs: sums that a step of its axis takes node by node.

Where worlds stand in the lanes, each cell between two nodes has a list of the spheres that press there, and the sums
are made when the step comes to a node: a node then needs room for one number. Where nodes of one world stand side by
side, each sphere adds to the sums of both nodes.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from haustra.envs.sim.linear.layout import PRESS, Layout
from haustra.envs.sim.linear.memory import Lanes
from haustra.envs.sim.linear.sweep import NodeNumbers, NodeRows, Nodes
from haustra.envs.sim.linear.trace import Changing, Program, Value
from haustra.models.wall.moving_colon import grip_resistance, lean_grip
from haustra.models.wall.vectors import Vector, dot

GRIP, SQUARE, DAMPED, LEANS, PULLED, COUPLES = 0, 1, 2, 3, 4, 7
"""Places of the sums: how much spheres grip a node, what resists that its section turns, flattens and leans, their
force (3), and by rows the force on the levers (9)."""
_FORCE, _HELD = 0, 9
"""Where a sphere's room holds its force at a step's end, and behind it the next sphere of its cell; then, after three
slots, its drag and damper; the lever at which the colon is held (`layout.SPHERE_ROOM`)."""
_NOBODY = -1.0


class Touch(NamedTuple):
    """How a sphere presses."""

    held: Vector
    """Its lever on the wall at rest [m]."""
    force: Vector
    """On the wall [N]."""
    damper: Value
    """What damps the wall along the normal [N s/m]."""
    drag: Value
    """Across it [N s/m]."""

    def sums(self, xp: Any) -> list[Value]:
        """What a node would be done to if it were all there: `PRESS` numbers."""
        damped, square, (held, force) = grip_resistance(self.damper), dot(self.held, self.held), self[:2]
        leans, grips = lean_grip(xp, force, damped, self.drag), damped + self.drag
        couples = [force[i] * held[j] for i in range(3) for j in range(3)]
        return [grips, grips * square, damped * square, leans * square, *force, *couples]


class PressRows:
    """The sums of each node, where nodes stand side by side."""

    def __init__(self, program: Program, layout: Layout, room: Lanes) -> None:
        """Bind rooms to work in."""
        self._program, self._layout, self._room = program, layout, room
        self._rows = NodeRows(room, layout.press_room + layout.abreast * PRESS, PRESS // 4)

    def clear(self, cell: Nodes) -> None:
        """Let nothing press on these nodes."""
        self._rows.put(cell, 0, [0.0] * PRESS)

    def add(self, cell: tuple[Value, Value], sphere: Value, touch: Touch) -> None:
        """Let spheres that stand side by side press: one after the other, since they may press on the same nodes."""
        program, room, layout, values = self._program, self._room, self._layout, touch.sums(self._program.xp)
        abreast, scratch = program.abreast, room.rows(layout.press_scratch, PRESS // 4)
        for four in range(0, PRESS, 4):
            scratch.put(program.index(0), four, values[four : four + 4])
        program.settle()
        for lane, (at, share) in enumerate(zip(*map(program.apart, cell), strict=True)):
            for number in range(0, PRESS, abreast):
                value = room.load_next(layout.press_scratch + (PRESS * lane + number))
                for later, part in enumerate((1 - share, share)):
                    slot = layout.press_room + (at + (abreast + later)) * PRESS + number
                    room.store_next(slot, room.load_next(slot) + part * value)

    def grip(self, node: Nodes, beyond: Value) -> Value:
        """How much spheres grip nodes before that one [N s/m]."""
        return self._program.xp.where(node.each < beyond, self._rows.load(node, GRIP), 0.0)

    def now(self, node: Nodes, number: int) -> Value:
        """Another of the sums, of nodes that are gripped."""
        return self._rows.load(node, number)

    def before(self, node: Nodes, number: int) -> Value:
        """Another of the sums, of nodes that the sweep has passed."""
        return self._rows.load(node, number)


class PressLists:
    """A list of the spheres that press in each cell, whose sums are made when the step comes to a node."""

    def __init__(
        self,
        program: Program,
        layout: Layout,
        arrays: tuple[Lanes, Lanes],
        numbers: tuple[NodeNumbers, NodeNumbers],
        cell_of: Callable[[Value], tuple[Value, Value]],
    ) -> None:
        """Bind them.

        Args:
            program: to write to.
            layout: of states and rooms.
            arrays: states and rooms.
            numbers: of nodes: where each has the first sphere of its list, and four that are free in the sweep.
            cell_of: finds in which cell an arc length is, and which share of it is behind the place.
        """
        self._program, self._layout, self._cell_of = program, layout, cell_of
        self._state, self._room = arrays
        self._heads, self._kept = numbers
        self._sums: Any = None

    def clear(self, cell: Nodes) -> None:
        """Let nothing press on a node."""
        self._heads.put(cell, 0, (_NOBODY,))

    def add(self, cell: tuple[Value, Value], sphere: Value, touch: Touch) -> None:
        """Let a sphere press, in the worlds in which it touches: it goes before the others of its cell."""
        program, first, others = self._program, self._first(sphere), self._heads.gather(cell[0], 0)
        self._room.put(first + _FORCE, (*touch.force, others))
        own = program.xp.where(touch.damper > 0, program.real_of(sphere), others)
        self._heads.scatter(cell[0], 0, own)

    def grip(self, node: Nodes, beyond: Value) -> Value:
        """How much spheres grip a node before that one [N s/m]; the other sums are made with it."""
        self._sums = Changing(self._program, [0.0] * PRESS)
        for later in range(2):
            self._add_up(node.back(later), node.each < beyond, later)
        grip = self._sums.now[GRIP]
        with self._program.when(grip > 0):
            self._kept.put(node, 0, (*self._sums.now[PULLED:COUPLES], self._sums.now[SQUARE]))
        return grip

    def now(self, node: Nodes, number: int) -> Value:
        """Another of the sums, of the node that was asked for last."""
        return self._sums.now[number]

    def before(self, node: Nodes, number: int) -> Value:
        """The force, or what resists, of a gripped node that the sweep has passed."""
        return self._kept.load(node, 3 if number == SQUARE else number - PULLED)

    def _add_up(self, cell: Nodes, inside: Value, later: int) -> None:
        """Add what the spheres of a cell do to its first node, or its last."""
        program, xp, room = self._program, self._program.xp, self._room
        inside = inside & (cell.each >= 0)
        sphere = program.variable(xp.where(inside, self._heads.load(cell, 0), _NOBODY))
        with program.repeat(lambda: sphere.value >= 0):
            here, at = sphere.value >= 0, xp.int32(xp.maximum(sphere.value, 0.0))
            first = at * self._layout.sphere_numbers
            force_x, force_y, force_z, follows, _, _, _, drag, damper, *held = (
                room.gather(first, self._layout.sphere_room + slot) for slot in range(_HELD + 3)
            )
            share = self._cell_of(self._state.gather(at, self._layout.arcs))[1]
            part = xp.where(here, share if later else 1 - share, 0.0)
            touch = Touch((held[0], held[1], held[2]), (force_x, force_y, force_z), damper, drag)
            more = (xp.where(here, part * value, 0.0) for value in touch.sums(xp))
            self._sums.now = tuple(total + each for total, each in zip(self._sums.now, more, strict=True))
            sphere.value = xp.where(here, follows, _NOBODY)

    def _first(self, sphere: Value) -> Value:
        return self._layout.sphere_room + sphere * self._layout.sphere_numbers
