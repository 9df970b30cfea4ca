"""The control step of a scope that is alone: its joints, links and spheres stand in the processor's lanes.

What follows link from link is gone through in turn, as in `haustra.envs.sim.linear.program`, and does no more than
that: sines, springs, inertias and what spheres meet are found before or after it, so many at a time.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from haustra.envs.sim.linear.articulated import link_bias, link_inertia, place_inertia
from haustra.envs.sim.linear.axis import Axis
from haustra.envs.sim.linear.layout import JOINT_ROOM, SPHERE_ROOM
from haustra.envs.sim.linear.program import INWARDS, SPRING, Link, ScopeProgram, flat
from haustra.envs.sim.linear.trace import Changing, Value, Variable
from haustra.models.wall.lumen_table import WINDOW
from haustra.models.wall.vectors import Vector, add, times

_DRIVEN, _TURNED, _SCALE = JOINT_ROOM, JOINT_ROOM + 2, JOINT_ROOM + 4
"""Where joints' rooms hold what drives and damps them, sine and 1 - cosine, and what scales them."""
_OWN = 3
"""Where links' rooms hold inertia and wrench, behind their direction."""
_FELT, _PUSHED, _LEVER, _CENTRE = SPHERE_ROOM, SPHERE_ROOM + 21, SPHERE_ROOM + 27, SPHERE_ROOM + 30
"""Where spheres' rooms hold what their links feel, inertia and wrench, and before that where spheres are and how they
move; then the levers of their surfaces; and where they are."""


class AloneProgram(ScopeProgram):
    """Writes down the control step of one scope of one structure class."""

    @contextmanager
    def _beside(self, count: Value, registers: int = 1, *, follows: bool = False) -> Iterator[Value]:
        """The first of those that stand side by side, in so many registers, of that many things.

        Where each `follows` the one before it on the shaft, nothing bounds the first.
        """
        program = self.program
        with program.side_by_side(self.layout.abreast, registers) as abreast:
            if follows:
                self._begin_following()
            with program.loop(0, (count + (abreast - 1)) // abreast) as group:
                yield group * abreast

    def advance(self, count: Any, going: Value | None = None) -> None:
        """As every program's."""
        with self.program.loop(0, self.dofs) as dof:
            self.joints.put(dof, _SCALE, (super().scale(dof),))
        super().advance(count, going)

    def scale(self, dof: Any) -> Value:
        """What the world scales joints by."""
        return self.joints.load(dof, _SCALE)

    def chain(self, each: Callable[[Value, Link], None]) -> Link:
        """As every program's."""
        with self._beside(self.dofs) as dof:
            self.joints.put(dof, _TURNED, self.program.xp.sine_versine(self.state.load_next(dof)))
        return super().chain(each)

    def _turned(self, dof: Value) -> tuple[Value, Value]:
        return self.joints.load(dof, _TURNED), self.joints.load(dof, _TURNED + 1)

    def _reached(self) -> Value:
        program, xp = self.program, self.program.xp
        furthest = program.variable(0.0)
        with self._beside(self.spheres) as sphere:
            arc = self.state.load_next(self.layout.arcs + sphere)
            inside = program.numbered(sphere) < self.spheres
            for each in program.apart(xp.where(inside, arc, 0.0)):
                furthest.value = xp.maximum(furthest.value, each)
        return furthest.value + WINDOW

    def _outwards(self) -> None:
        tip = self.chain(self._meet)
        self._place(self.spheres, tip, self.scope("tip"))
        # Two registers: what one waits for, the other does not.
        with self._beside(self.spheres + 1, 2, follows=True) as sphere:
            along, centre, turning, moving = (self.touches.vector(sphere, _FELT + 3 * part) for part in range(4))
            self._touch(sphere, along, centre, (turning, moving), self._feeling(sphere, _PUSHED))
        with self._beside(self.bodies) as body:
            axis, turning, moving, first, last = (self.links.vector(body, 3 * part) for part in range(5))
            own = self._masses(body)
            torque, force = link_bias(own, axis, turning, moving, (first, last))
            self.links.put(body, _OWN, (*flat(link_inertia(axis, *own)), *torque, *force))
        if self.axis:
            self._thread_all(self.axis)

    def _thread_all(self, axis: Axis) -> None:
        """`_thread` all spheres, in turn."""
        axis.threads.begin()
        with self.program.loop(0, self.bodies) as body:
            wrench = _OWN + 21

            def feel(more: tuple[Value, ...]) -> None:
                felt = (self.links.load(body, wrench + i) + each for i, each in enumerate(more))
                self.links.put(body, wrench, tuple(felt))

            with self.program.loop(*self.spheres_of(body)) as sphere:
                along = times(self.sphere_place(sphere), self.links.vector(body, 0))
                self._thread(axis, sphere, along, self.touches.vector(sphere, _CENTRE), feel)

    def _keep_touch(self, sphere: Value, way: Any, damped: Any, held: Vector, lever: Vector) -> None:
        super()._keep_touch(sphere, way, damped, held, lever)
        drag, damper = damped
        self.touches.put(sphere, _FELT, flat(place_inertia(lever, way[:3], self.h * damper, self.h * drag)))
        self.touches.put(sphere, _LEVER, lever)

    def _lever(self, sphere: Value, axis: Vector, normal: Vector) -> Vector:
        return self.touches.vector(sphere, _LEVER)

    def _meet(self, body: Value, link: Link) -> None:
        rates = *link.turning_rate, *link.moving_rate
        self.links.put(body, 0, (*link.axis, *link.turning, *link.moving, *rates))
        self._place_all(body, link)

    def _place_all(self, body: Value, link: Link) -> None:
        """`_place` the spheres of a link."""
        first, last = self.spheres_of(body)
        with self._beside(last - first) as more:
            self._place(first + more, link, self.design.load_next(self._places + first + more))

    def _place(self, sphere: Value, link: Link, along: Value) -> None:
        """Leave where spheres of a link are, so far along its axis, and how it moves."""
        lever = times(along, link.axis)
        centre = add(link.place, lever)
        self.touches.put(sphere, _FELT, (*lever, *centre, *link.turning, *link.moving))
        if self.axis:
            self.touches.put(sphere, _CENTRE, centre)

    def _to_look_up(self, sphere: Value, arc: Value) -> Value:
        return self.program.xp.where(self.program.numbered(sphere) < self.spheres, arc, -1.0)  # the tip touches nothing

    def _look_along(self, force: Changing, deepest: Variable) -> Link:
        def look(body: Value, link: Link) -> None:
            self.links.put(body, 0, link.place)
            self._place_all(body, link)

        tip = self.chain(look)
        with self._beside(self.spheres, 2, follows=True) as sphere:
            self.touches.put(sphere, _FELT, (0.0, 0.0, 0.0))
            self._press(sphere, self.touches.vector(sphere, _FELT + 3), deepest, self._feeling(sphere))
        with self.program.loop(0, self.bodies) as body:
            pressed = Changing(self.program, (0.0, 0.0, 0.0))
            with self.program.loop(*self.spheres_of(body)) as sphere:
                self._note_coil(sphere, self.touches.vector(sphere, _FELT + 3))
                pressed.now = add(pressed.now, self.touches.vector(sphere, _FELT))
            self._note_force(body, pressed.now, force)
        return tip

    def _feeling(self, sphere: Value, slot: int = _FELT) -> Callable[[tuple[Value, ...]], None]:
        return lambda felt: self.touches.put(sphere, slot, felt)

    def _inwards(self) -> None:
        pulls = () if self.wires else self._pulls()
        with self._beside(self.dofs) as dof:
            sprung, damping, armature = self._sprung(dof, pulls)
            self.joints.put(dof, _DRIVEN, (sprung, armature + self.h * damping))
        for side in range(2):
            dof = self.program.index(side)
            total, damped = self.joints.load(dof, _DRIVEN), self.joints.load(dof, _DRIVEN + 1)
            hand, held = self._by_hand(dof, side)
            self.joints.put(dof, _DRIVEN, (total + hand, damped + self.h * held))
        super()._inwards()

    def _driven(self, dof: Value, pulls: Any, slides: int) -> tuple[Value, Value]:
        return self.joints.load(dof, _DRIVEN), self.joints.load(dof, _DRIVEN + 1)

    def _with_own(self, body: Value, axis: Vector, sums: tuple[Value, ...]) -> tuple[Value, ...]:
        program = self.program
        total = [program.variable(each + self.links.load(body, _OWN + i)) for i, each in enumerate(sums)]
        with program.loop(*self.spheres_of(body)) as sphere, program.when(self.touches.load(sphere, SPRING) > 0):
            for number, each in enumerate(total):
                each.value = each.value + self.touches.load(sphere, _FELT + number)
        return tuple(each.value for each in total)

    def _accelerate(self, fastest: Any) -> None:
        super()._accelerate(fastest)
        with self._beside(self.spheres) as sphere:
            turning, moving = self.touches.vector(sphere, _FELT), self.touches.vector(sphere, _FELT + 3)
            self._leave(sphere, INWARDS, turning, moving)

    def _leave_wall(self, body: Value, axis: Vector, turning_rate: Vector, moving_rate: Vector) -> None:
        first, last = self.spheres_of(body)
        with self._beside(last - first) as more:
            self.touches.put(first + more, _FELT, (*turning_rate, *moving_rate))
