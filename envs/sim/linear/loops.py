"""Loops of colon that touch each other, in programs: the laws of `haustra.models.wall.loops`, node by node."""

from collections.abc import Callable

from haustra.envs.sim.linear.layout import Layout
from haustra.envs.sim.linear.sweep import NodeNumbers, Nodes, along
from haustra.envs.sim.linear.trace import Changing, Program, Value
from haustra.models.wall.loops import MARGIN, STALE, apart, contact, nearer, nearness, touch_force
from haustra.models.wall.vectors import Vector, times

_PLACE, _GIRTH, _PARTNER, _FORCE, _BOUND = 0, 3, 4, 5, 8
"""What each node's room holds for them: `layout.LOOP_ROOM`."""
_FAR = 1e6
"""No two nodes are so far from each other [m^2]; engineering choice."""


class Loops:
    """What nodes of an axis do to others that are far along it."""

    def __init__(
        self,
        program: Program,
        layout: Layout,
        room: NodeNumbers,
        now: Callable[[Nodes], Vector],
        row: Callable[[Value, str], Value],
    ) -> None:
        """Bind them.

        Args:
            program: to write to.
            layout: of states and rooms.
            room: of the nodes to work in.
            now: where nodes are [m].
            row: a number of a node at rest, by its name in the layout's columns.
        """
        self.program, self.room, self.nodes, self.abreast = program, room, layout.nodes, layout.abreast
        self._now, self._row = now, row
        self._near, self._way = program.variable(0.0), program.variable(STALE)
        """Whether any node has a partner, and by how much nodes may have come nearer since that was seen [m]."""

    def forget(self) -> None:
        """Look for partners again before the next step."""
        self._way.value = STALE

    def moved(self, square: Value, h: float) -> None:
        """Take note of a step.

        Args:
            square: of the speed of the world's fastest node [m^2/s^2]; side by side, of several.
            h: time step [s].
        """
        fastest = self.program.constant(0.0)
        for each in self.program.apart(square):
            fastest = self.program.xp.maximum(each, fastest)
        self._way.value = self._way.value + nearer(self.program.xp.sqrt(fastest), h)

    def _look(self) -> None:
        """Find each node's partner."""
        program, xp, room, nodes = self.program, self.program.xp, self.room, self.nodes
        spacing = self._row(program.index(0), "between")
        self._near.value, self._way.value = 0.0, 0.0
        with program.side_by_side(self.abreast):
            with along(program, nodes, 0, nodes) as i:
                room.put(i, _PLACE, (*self._now(i), self._row(i.within, "girth")))
            found = program.variable(0.0)
            with along(program, nodes, 0, nodes) as i:
                here, girth = room.vector(i, _PLACE), room.load(i, _GIRTH)
                best, kept, partner = (program.variable(start) for start in (_FAR, 0.0, -1.0))
                with program.loop(0, nodes // 2) as pair:
                    j = pair * 2 + 1
                    both = girth + room.gather(j, _GIRTH)
                    near = nearness(room.gather_vector(j, _PLACE), here, both)
                    closer = apart(program.real_of(i.each - j), spacing, both) & (near < best.value)
                    best.value = xp.where(closer, near, best.value)
                    kept.value = xp.where(closer, both, kept.value)
                    partner.value = xp.where(closer, program.real_of(j), partner.value)
                near = (best.value < MARGIN * (2 * kept.value + MARGIN)) & (i.each < nodes)
                room.put(i, _PARTNER, (xp.where(near, partner.value, -1.0),))
                found.value = xp.where(near, 1.0, found.value)
            for each in program.apart(found.value):
                self._near.value = xp.maximum(self._near.value, each)

    def press(self) -> None:
        """Find what loops do to all nodes now."""
        program, room, nodes = self.program, self.room, self.nodes
        with program.when(self._way.value >= STALE):
            self._look()
        with program.when(self._near.value > 0):
            with program.side_by_side(self.abreast), along(program, nodes, 0, nodes) as i:
                room.put(i, _FORCE, (0.0, 0.0, 0.0, 0.0))
            with program.loop(0, nodes) as node:
                i = Nodes.at(program, node, nodes)
                partner = room.load(i, _PARTNER)
                with program.when(partner >= 0):
                    self._touch(i, partner)

    def _touch(self, i: Nodes, partner: Value) -> None:
        xp, room, last = self.program.xp, self.room, self.nodes - 1
        at = xp.int32(xp.maximum(partner, 0.0))
        three = xp.maximum(at - 1, 0), at, xp.minimum(at + 1, last)
        there = (self._now(Nodes.at(self.program, node, self.nodes)) for node in three)
        shares, distance, way = contact(xp, self._now(i), *there)
        kept = room.load(i, _GIRTH) + room.gather(at, _GIRTH)
        force, slope = touch_force(xp, distance, kept, 0.5 * self._row(i.within, "touch"))
        force, slope = (xp.where(partner >= 0, each, 0.0) for each in (force, slope))
        self._add(i.first, times(force, way), 2 * slope)
        for node, share in zip(three, shares, strict=True):
            self._add(node, times(-share * force, way), 2 * share * slope)

    def _add(self, node: Value, force: Vector, bound: Value) -> None:
        for more, value in enumerate((*force, bound)):
            self.room.scatter(node, _FORCE + more, self.room.gather(node, _FORCE + more) + value)

    def of(self, node: Nodes) -> tuple[Vector, Value]:
        """Force of loops on a node [N], and a bound of its slope [N/m]."""
        found = Changing(self.program, [0.0] * 4)
        with self.program.when(self._near.value > 0):
            found.now = *self.room.vector(node, _FORCE), self.room.load(node, _BOUND)
        return found.now[:3], found.now[3]
