"""Shafts that are threaded through a colon that moves, in programs: `haustra.models.wall.threads`, gap by gap."""

from collections.abc import Callable

from haustra.envs.sim.linear.layout import Layout
from haustra.envs.sim.linear.sweep import NodeNumbers, Nodes
from haustra.envs.sim.linear.trace import Changing, Program, Value
from haustra.models.wall.threads import RING, lumen_radius, ring_force
from haustra.models.wall.vectors import Vector, cross, dot, minus, times

_FORCE = 0
"""What each node's room holds: `layout.THREAD_ROOM`."""
_NONE_MET = -1.0
"""How far in spheres are before the first one is met [m], by way of an engineering choice: nothing is drawn to where
that may have come from."""


class Threads:
    """What a shaft does to the nodes between its spheres."""

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
        self._program, self._room, self._nodes = program, room, layout.nodes
        self._now, self._row = now, row
        self._drawn, self._furthest = program.variable(0.0), program.variable(0.0)
        """Whether any node of these worlds is drawn, and how far in spheres are up to the last that was met [m]."""
        self._place = Changing(program, (0.0, 0.0, 0.0))

    def begin(self) -> None:
        """Before the first sphere of a step."""
        self._drawn.value, self._furthest.value = 0.0, _NONE_MET

    def meet(self, place: Vector, arc: Value, spacing: Value, feel: Callable[[Vector, Vector], None]) -> None:
        """The next sphere.

        Args:
            place: its middle [m].
            arc: its arc length [m].
            spacing: arc length between nodes [m].
            feel: is told, where there is any, the force on the shaft and its moment about the sphere.
        """
        program, xp, before, furthest = self._program, self._program.xp, self._place.now, self._furthest.value
        self._place.now, self._furthest.value = place, xp.maximum(xp.maximum(furthest, arc), 0.0)
        beyond = program.real_of(self._nodes)
        node = program.variable(xp.where(furthest < 0, beyond, xp.floor(furthest / spacing) + 1))
        last = xp.minimum(xp.floor(xp.maximum(arc, 0.0) / spacing), program.real_of(self._nodes - 1))
        with program.repeat(lambda: node.value <= last):
            at = Nodes.at(program, xp.int32(node.value), self._nodes)
            radius = lumen_radius(xp, self._row(at.within, "drag"), self._row(at.within, "turn_drag"))
            out, force, borne = ring_force(xp, self._now(at), before, place, radius)
            drawn = (out > 0) & (node.value <= last)
            with program.when(drawn):
                self._clear()
                force = xp.where(drawn, force[0], 0.0), xp.where(drawn, force[1], 0.0), xp.where(drawn, force[2], 0.0)
                for number, value in enumerate(force, _FORCE):
                    old = self._room.gather(at.within, number)
                    self._room.scatter(at.within, number, xp.where(drawn, value, old))
                feel(times(-1.0, force), cross(force, minus(borne, place)))
            node.value = node.value + 1

    def _clear(self) -> None:
        program = self._program
        with program.when(self._drawn.value <= 0):
            with program.loop(0, self._nodes) as node:
                self._room.put(Nodes.at(program, node, self._nodes), _FORCE, [0.0] * 3)
            self._drawn.value = 1.0

    def of(self, node: Nodes) -> tuple[Vector, Value]:
        """Force of the shaft on a node [N], and a bound of its slope [N/m]."""
        found = Changing(self._program, [0.0] * 3)
        with self._program.when(self._drawn.value > 0):
            found.now = self._room.vector(node, _FORCE)
        return found.now, self._program.xp.where(dot(found.now, found.now) > 0, RING, 0.0)
