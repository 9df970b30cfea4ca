"""The program of one control step: scopes in tabulated colons, in three passes over their links a time step.

Outwards, poses, speeds, contacts and what they damp; inwards, the articulated-body recursion; outwards again,
accelerations, and with them positions, speeds and the forces of the wall at the step's end. Every law is the function
that the other backends call.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from inspect import unwrap
from typing import Any

from haustra.envs.sim.linear.articulated import (
    Inertia,
    freed,
    from_parent,
    hinge_force,
    link_bias,
    link_inertia,
    place_inertia,
    slide_force,
    turned_frame,
)
from haustra.envs.sim.linear.axis import Axis
from haustra.envs.sim.linear.layout import (
    BODY,
    DOF,
    JOINT_ROOM,
    LEAST,
    NODE,
    SCOPE,
    STRUCTURE,
    WORLD,
    Layout,
    seen_slot,
)
from haustra.envs.sim.linear.memory import Lanes, NumberRows, Numbers, Rows, Shared, Slots
from haustra.envs.sim.linear.press import Touch
from haustra.envs.sim.linear.sweep import Before
from haustra.envs.sim.linear.trace import Changing, Program, Value, Variable
from haustra.envs.sim.linear.turns import Turns
from haustra.envs.sim.linear.wires import SprungWires
from haustra.envs.sim.physics.hand import HAND_DAMPING, HAND_STIFFNESS, held_force
from haustra.envs.sim.physics.lock import lock_activation
from haustra.envs.sim.physics.stops import stop_torque
from haustra.envs.sim.physics.wires import borne_pulls, joint_angle
from haustra.envs.sim.state import SPEED_LIMIT
from haustra.models.devices.scope.wires import WIRE_NAMES, arriving_pulls
from haustra.models.wall.elasticity import ELASTICITIES, LINEAR
from haustra.models.wall.law import normal_force, place_contact, place_force
from haustra.models.wall.lumen_table import (
    WINDOW,
    Tables,
    axis_point,
    depth_bound,
    distended_radius,
    nearest_arc,
    station_width,
    wall_beside,
)
from haustra.models.wall.moving_colon import AT_REST
from haustra.models.wall.threads import threaded_arc
from haustra.models.wall.vectors import Vector, add, cross, dot, minus, norm, times

ARGUMENTS = ("state", "worlds", "seen", "room", "design", "structure", "stations", "wall", "axis", "driver",
             "asked", "told", "lookup", "widths")  # fmt: skip
"""Arrays of a program, in this order; then whole numbers: `COUNTS`."""
WRITTEN = ("state", "worlds", "seen", "room", "driver", "told")
"""What a program writes to."""
COUNTS = ("dofs", "bodies", "spheres", "nodes", "coils", "steps", "row", "first", "last")
"""`row`: numbers in a row of what drivers are asked and tell; the last two are blocks of worlds."""

# Laws without the checks of arrays' shapes: what they are called with here are values of a program.
_arriving_pulls, _borne_pulls = unwrap(arriving_pulls), unwrap(borne_pulls)
_lock_activation, _stop_torque = unwrap(lock_activation), unwrap(stop_torque)

_HAND_LIMITS = ("push_limit", "torque_limit")
_NONE: Vector = (0.0, 0.0, 0.0)
INWARDS: Vector = (0.0, 0.0, 1.0)
"""Direction in which the first link begins."""
_DIRECTION, _WRENCH = 0, 3
"""What links' rooms hold: `layout.BODY_ROOM`."""
_NORMAL, _SPEED, SPRING, _DRAG, _DAMPER, _HELD = 0, 3, 6, 7, 8, 9
"""What spheres' rooms hold: `layout.SPHERE_ROOM`; at a step's end the normal force stands where the spring's did."""
_FASTER = 6
"""Where joints' rooms hold tau / D (`layout.JOINT_ROOM`), and at a step's end the new speed."""
_DRIVEN = DOF.index("stiffness")
"""Behind its axis a joint's design has what drives it."""
_ALONG = 3
"""Part of the wall's numbers that is its normal's along the colon, which grows with width."""
_UNBOUND = 1e6
"""Arc length of what is before the first sphere, by way of an engineering choice: it bounds none [m]."""
_BEFORE = 0.02
"""So far before the anus, nothing of a colon that moves is near [m]: twice as far as a sphere may move in a step."""


class ScopeProgram:
    """Writes down the control step of scopes of one structure class: a chain of hinges behind one slide."""

    def __init__(
        self,
        program: Program,
        arrays: dict[str, Any],
        layout: Layout,
        coils: Value,
        *,
        timestep: float,
        elasticity: str = LINEAR,
        friction_rise: float = 0.0,
    ) -> None:
        """Bind arrays and counts.

        Args:
            program: to write to.
            arrays: by the names of `ARGUMENTS`.
            layout: of what each world holds.
            coils: how many the imager has.
            timestep: [s].
            elasticity: name of the law by which the wall's force grows with depth.
            friction_rise: of the friction coefficient with sliding speed [s/m].
        """
        self.program, self.h = program, timestep
        self._elasticity, self._friction_rise = ELASTICITIES[elasticity], friction_rise
        self.layout, self.coils = layout, coils
        self.dofs, self.bodies, self.spheres = layout.dofs, layout.bodies, layout.spheres
        self.state: Lanes = arrays["state"]
        self.seen: Lanes = arrays["seen"]
        self.room: Lanes = arrays["room"]
        self.design: Slots = arrays["design"]
        self.structure: Shared = arrays["structure"]
        self.asked: Lanes = arrays["asked"]
        self.told: Lanes = arrays["told"]
        self.lookup: Shared = arrays["lookup"]
        self.first_world: Value = arrays["first_world"]
        self._world: Lanes = arrays["worlds"]
        stations, wall = arrays["stations"], arrays["wall"]
        self.gas: HeldOpen | None = None
        """How wide gas holds the worlds' lumens, where there is gas."""
        if widths := arrays["widths"]:
            self.gas = HeldOpen(program, widths, self.world)
        parts = _Points(stations, self.gas), _Frames(stations), _Wall(wall, self.gas)
        self.tables = Tables(*parts, step=None, first=None, count=None, axes=None, device_radius=None)
        links, self._places, self._scope, _ = layout.design
        abreast = layout.abreast
        self.joint_design = Numbers(self.design, program.index(0), len(DOF), abreast)
        self.link_design = Numbers(self.design, links, len(BODY), abreast)
        self.joints = Numbers(self.room, layout.joint_room, layout.joint_numbers, abreast)
        self.links = Numbers(self.room, layout.body_room, layout.body_numbers, abreast)
        self.touches = NumberRows(self.room, layout.sphere_room, layout.sphere_numbers, layout.sphere_row)
        self._scales = self.bodies * STRUCTURE
        self.wires = SprungWires(self) if layout.wheels else None
        other = self.room.from_slot(layout.other_room) if layout.by_turns else None
        self._turns = None if other is None else Turns(program, self.state, other)
        self._going = program.variable(0.0)
        self.axis: Axis | None = None
        if nodes := arrays["axis"]:
            own = self.state, self._world, self.room
            self.axis = Axis(program, self.layout, own, nodes, (self.tables, self._stations()))

    @property
    def now(self) -> Lanes:
        """Joints' positions and speeds and spheres' normal forces, by the slots of the state."""
        return self._turns.now if self._turns else self.state

    # Numbers by name.

    def world(self, name: str) -> Value:
        """A number of the world, by its name in `WORLD`."""
        return self._world.load(WORLD.index(name))

    def ask(self, name: str, value: Any) -> None:
        """Put a number of the world, by its name in `WORLD`."""
        self._world.store(WORLD.index(name), value)

    def reading(self, name: str) -> Value:
        """The first number of what was read off, by its name in `SEEN`."""
        return self.seen.load(seen_slot(name))

    def joint(self, dof: Any, name: str) -> Value:
        """A number of a joint's design, by its name in `DOF`."""
        return self.joint_design.load(dof, DOF.index(name))

    def link(self, body: Any, name: str) -> Value:
        """A number of a link's design, by its name in `BODY`."""
        return self.link_design.load(body, BODY.index(name))

    def scope(self, name: str) -> Value:
        """A number of the whole design, by its name in `SCOPE`."""
        return self.design.load(self._scope + SCOPE.index(name))

    def sphere_place(self, sphere: Any) -> Value:
        """Along its link's axis [m]."""
        return self.design.load(self._places + sphere)

    def joints_of(self, body: Any) -> tuple[Value, Value]:
        """First joint of a link, and the one after its last."""
        return self.structure.load(body * STRUCTURE), self.structure.load(body * STRUCTURE + 1)

    def hinges_of(self, body: Any) -> tuple[Value, Value]:
        """The joints of a link but the slide, which is the first joint of the first."""
        first, last = self.joints_of(body)
        return self.program.xp.where(body == 0, 1, first), last

    def spheres_of(self, body: Any) -> tuple[Value, Value]:
        """First sphere of a link, and the one after its last."""
        return self.structure.load(body * STRUCTURE + 2), self.structure.load(body * STRUCTURE + 3)

    def scale(self, dof: Any) -> Value:
        """What the world scales a joint by: a number of its own, and a stiffening ring."""
        return self._world.load(self._scaled_by(dof)) * (1 + self.world("ring") * self.joint(dof, "ring"))

    def _scaled_by(self, dof: Any) -> Value:
        """Which number of the world scales a joint."""
        return self.structure.load(self._scales + dof)

    # The control step.

    def lay(self) -> None:
        """Lay the scopes of worlds that begin straight, tips at the start depth, in colons at rest."""
        program, xp, layout = self.program, self.program.xp, self.layout
        begins = self.world("begins") > 0

        def put(slot: Any, value: Any) -> None:
            self.state.store(slot, xp.where(begins, value, self.state.load(slot)))

        with program.when(begins):
            with program.loop(0, layout.state) as slot:
                put(slot, 0.0)
            start = program.variable(0.0)
            with program.loop(0, self.bodies) as body:
                start.value = start.value + self.link(body, "offset")
                with program.loop(*self.spheres_of(body)) as sphere:
                    put(layout.arcs + sphere, start.value + self.sphere_place(sphere))
            put(layout.arcs + self.spheres, start.value + self.scope("tip"))
            with program.loop(0, layout.nodes) as node:
                put(layout.node_state(AT_REST.index(1.0)) + node * (NODE if layout.abreast == 1 else 1), 1.0)
            for slot in (1, layout.hand + 1):
                put(slot, self.world("start_roll"))
            if self.axis and self.axis.loops:
                self.axis.loops.forget()
            self.ask("begins", 0.0)

    def advance(self, count: Any, going: Value | None = None) -> None:
        """So many time steps under what the hands ask for; a world that breaks in one stays as it was before that.

        Args:
            count: of steps.
            going: which worlds are to go on; all that have not broken when None.
        """
        program, xp = self.program, self.program.xp
        alive = self.world("alive") > 0
        going = alive if going is None else alive & going
        asked = going
        for name in ("stiffness", "damping_time", "push_rate", "roll_rate"):
            asked = asked & xp.isfinite(self.world(name))
        # Springs pull by what they are stretched, in every step; else pulls arrive before the first.
        asked = asked & (self.wires.asked() if self.wires else self._let_pulls_arrive(asked))
        self._going.value = xp.where(asked, 1.0, 0.0)
        with program.loop(0, count):
            self._step()
        if self._turns:
            layout = self.layout
            self._turns.bring_back((0, layout.arcs), (layout.normals, layout.hand))
        self.ask("alive", xp.where(going, self._going.value, self.world("alive")))

    @property
    def going(self) -> Value:
        """Which worlds go on: those that are asked to, and have not broken."""
        return self._going.value > 0

    def _step(self) -> None:
        """A time step: of a world that breaks in it, nothing is taken over but where its spheres are looked up."""
        program, xp = self.program, self.program.xp
        fastest = program.variable(0.0)
        beyond = self.axis.shape(self._reached()) if self.axis else None
        self._outwards()
        self._inwards()
        self._accelerate(fastest)
        if self.axis and beyond is not None:
            self.axis.step(self.h, fastest, (SPEED_LIMIT, self.going), beyond)
        aims = [
            self.state.load(self.layout.hand + side) + self.h * self.world(rate)
            for side, rate in enumerate(("push_rate", "roll_rate"))
        ]
        sound = fastest.value < SPEED_LIMIT
        for aim in (*aims, *(self.wires.ends if self.wires else ())):
            sound = sound & xp.isfinite(aim)
        self._going.value = xp.where(sound, self._going.value, 0.0)
        with program.when(self.going):
            self._take_over(aims)

    def _take_over(self, aims: list[Value]) -> None:
        """Let new speeds move what goes on, and keep what presses.

        Args:
            aims: of the hand, along and about the shaft.
        """
        program, state, layout = self.program, self.state, self.layout

        def put(slot: Any, value: Any, inside: Value | None = None) -> None:
            going = self.going if inside is None else self.going & inside
            state.store_next(slot, program.xp.where(going, value, state.load_next(slot)))

        if self._turns:
            self._turns.change()
        else:
            with self._beside(self.dofs) as dof:
                inside, speed = program.numbered(dof) < self.dofs, self.joints.load(dof, _FASTER)
                put(dof, state.load_next(dof) + self.h * speed, inside)
                put(layout.speeds + dof, speed, inside)
            with self._beside(self.spheres) as sphere:
                pressed, inside = self.touches.load(sphere, SPRING), program.numbered(sphere) < self.spheres
                put(layout.normals + sphere, pressed, inside)
        if self.axis:
            self.axis.take_over(self.h, lambda: self.going)
        pulls = enumerate(self.wires.ends) if self.wires else ()
        for slot, value in (*enumerate(aims), *((2 + wire, pull) for wire, pull in pulls)):
            put(layout.hand + slot, value)
        put(layout.time, state.load(layout.time) + self.h)

    @contextmanager
    def _beside(self, count: Value, registers: int = 1) -> Iterator[Value]:
        """Each of that many things; where these stand side by side, the first of some, in so many registers."""
        with self.program.loop(0, count) as thing:
            yield thing

    def sheath_angle(self) -> Value:
        """Angle that the shaft is bent through, summed regardless of direction [rad]."""
        program, xp = self.program, self.program.xp
        angle = program.variable(0.0)
        with program.loop(1, self.bodies) as body:
            first, _ = self.joints_of(body)
            first = xp.where(self._scaled_by(first) == WORLD.index("torsion"), first + 1, first)
            with program.when(self._scaled_by(first) == WORLD.index("bending")):
                x, y = self.state.load(first), self.state.load(first + 1)
                angle.value = angle.value + joint_angle(xp, x, y)
        return angle.value

    def _let_pulls_arrive(self, asked: Value) -> Value:
        """Put what arrives of the pulls in worlds that were asked soundly; whether all of it is a number."""
        xp, angle = self.program.xp, self.sheath_angle()
        arrived = [
            _arriving_pulls(
                xp,
                self.world(name),
                self.state.load(self.layout.pulls + wire),
                friction=self.scope("wire_friction"),
                hysteresis=self.scope("wire_hysteresis"),
                sheath_angle=angle,
            )
            for wire, name in enumerate(WIRE_NAMES)
        ]
        for pull in arrived:
            asked = asked & xp.isfinite(pull)
        for wire, pull in enumerate(arrived):
            slot = self.layout.pulls + wire
            self.state.store(slot, xp.where(asked, pull, self.state.load(slot)))
        return asked

    def chain(self, each: Callable[[Value, "Link"], None]) -> "Link":
        """Go outwards along the chain, and do something at each link; the last one is returned."""
        program = self.program
        gravity = self.world("gravity_x"), self.world("gravity_y"), self.world("gravity_z")
        link = Link(program, times(-1.0, gravity))
        with program.loop(0, self.bodies) as body:
            offset = times(self.link(body, "offset"), link.axis)
            link.shift(offset)
            with program.when(body == 0):
                direction = link.direction(self._axis(0))
                self.joints.put(program.index(0), 7, direction)
                link.slide(direction, self.now.load(0), self.now.load(self.layout.speeds))
            with program.loop(*self.hinges_of(body)) as dof:
                self._fetch_joint(dof + 1)
                self.joint_design.fetch(dof + 1, 0, _DRIVEN)
                local = self._axis(dof)
                direction = link.direction(local)
                self.joints.put(dof, 7, direction)
                link.turn(local, direction, self._turned(dof), self.now.load(self.layout.speeds + dof))
            each(body, link)
        return link

    def _turned(self, dof: Value) -> tuple[Value, Value]:
        """Sine of a hinge's angle, and 1 less its cosine."""
        return self.program.xp.sine_versine(self.now.load(dof))

    def _reached(self) -> Value:
        """No sphere will be looked up further in [m]."""
        furthest = self.program.variable(0.0)
        with self.program.loop(0, self.spheres) as sphere:
            furthest.value = self.program.xp.maximum(furthest.value, self.state.load(self.layout.arcs + sphere))
        return furthest.value + WINDOW

    def _outwards(self) -> None:
        if self.axis:
            self.axis.threads.begin()
        self._begin_following()
        tip = self.chain(self._meet)
        slot = self.layout.arcs + self.spheres
        place = add(tip.place, times(self.scope("tip"), tip.axis))
        before = self.state.load(slot)
        self.state.store(slot, self.program.xp.where(self.going, self._followed(place, before)[0], before))

    def _meet(self, body: Value, link: "Link") -> None:
        """What a link's velocity needs, and what its spheres meet."""
        rates = link.turning_rate, link.moving_rate
        self.link_design.fetch(body + 1, 0, len(BODY))
        torque, force = link_bias(self._masses(body), link.axis, link.turning, link.moving, rates)
        sums = Changing(self.program, (*torque, *force))

        def feel(more: tuple[Value, ...]) -> None:
            sums.now = tuple(total + each for total, each in zip(sums.now, more, strict=True))

        with self.program.loop(*self.spheres_of(body)) as sphere:
            along = times(self.sphere_place(sphere), link.axis)
            self._touch(sphere, along, add(link.place, along), (link.turning, link.moving), feel)
            if self.axis:
                self._thread(self.axis, sphere, along, add(link.place, along), feel)
        self.links.put(body, _DIRECTION, (*link.axis, *sums.now))

    def _thread(
        self, axis: Axis, sphere: Value, along: Vector, centre: Vector, feel: Callable[[tuple[Value, ...]], None]
    ) -> None:
        """What the wall does to the shaft between a sphere and the one before it; the sphere's link feels it.

        Args:
            axis: of the colon.
            sphere: which.
            along: its place from its link's origin [m].
            centre: its place [m].
            feel: is told what the link feels of it, if there is any: torque and force.
        """

        def drawn(force: Vector, moment: Vector) -> None:
            feel((*times(-1.0, add(moment, cross(along, force))), *times(-1.0, force)))

        axis.meet(centre, self.state.load(self.layout.arcs + sphere), drawn)

    def _masses(self, body: Value) -> tuple[Value, Value, Value, Value]:
        """Mass of a link, its centre and its moments of inertia."""
        mass, centre, across, along = (self.link(body, name) for name in BODY[1:])
        return mass, centre, across, along

    def _touch(
        self, sphere: Value, along: Vector, centre: Vector, motion: tuple[Vector, Vector], feel: Callable[..., None]
    ) -> None:
        """What a sphere meets.

        Args:
            sphere: which, or the first of those that stand side by side.
            along: its place from its link's origin [m].
            centre: its place [m].
            motion: angular velocity of its link, and velocity of the link's origin.
            feel: is told what the link feels of it, if it touches: torque and force.
        """
        program, xp, state, layout = self.program, self.program.xp, self.state, self.layout
        turning, moving = motion
        self.design.fetch(self._places + sphere + 1)
        state.fetch(layout.arcs + sphere + 2)
        self.now.fetch(layout.normals + sphere + 2)
        before = state.load_next(layout.arcs + sphere)
        arc, rest = self._followed(centre, before)
        self._keep_arc(sphere, before, arc)
        arc = self._to_look_up(sphere, arc)
        carried = self.now.load_next(layout.normals + sphere) > 0
        self.touches.put(sphere, SPRING, (0.0,))
        with program.when(arc > 0):
            depth, normal, held, leaving = self.wall(rest, arc, near=True)
            lever = minus(along, times(self.scope("radius"), normal))
            speed = minus(add(moving, cross(turning, lever)), leaving)
            spring, damper, drag = place_contact(
                xp,
                depth,
                normal,
                speed,
                carried,
                stiffness=self.world("stiffness"),
                ahead=self.world("damping_time") + self.h,
                friction=self.world("friction"),
                friction_rise=self._friction_rise,
                elasticity=self._elasticity,
            )
            self.touches.put(sphere, SPRING, (spring,))
            with program.when(spring > 0):
                self._keep_touch(sphere, (*normal, *speed), (drag, damper), held, lever)
                force = place_force(spring, damper, drag, normal, speed)
                feel((*times(-1.0, cross(lever, force)), *times(-1.0, force)))

    def _keep_touch(self, sphere: Value, way: Any, damped: Any, held: Vector, lever: Vector) -> None:
        """Keep what a sphere that touches will be asked for.

        Args:
            sphere: which.
            way: normal of the wall, and speed against it.
            damped: drag, damper.
            held: lever at which a colon that moves is held [m].
            lever: of its surface from its link's origin [m].
        """
        self.touches.put(sphere, _NORMAL, way)
        self.touches.put(sphere, _DRAG, (*damped, *held) if self.axis else damped)

    def _lever(self, sphere: Value, axis: Vector, normal: Vector) -> Vector:
        """Lever of a sphere's surface from its link's origin [m]."""
        return minus(times(self.sphere_place(sphere), axis), times(self.scope("radius"), normal))

    def _keep_arc(self, sphere: Value, before: Value, arc: Value) -> None:
        """Keep the arc length of a sphere that was at another before, in worlds that go on."""
        inside = self.going & (self.program.numbered(sphere) <= self.spheres)
        self.state.store_next(self.layout.arcs + sphere, self.program.xp.where(inside, arc, before))

    def _to_look_up(self, sphere: Value, arc: Value) -> Value:
        """Where a sphere at an arc length is to be looked up; nothing is before the anus."""
        return arc

    def _begin_following(self) -> None:
        """Before the first sphere from the shaft's end, whose arc length nothing bounds."""
        self._follows = Before(self.program, *_NONE, _UNBOUND)

    def _followed(self, centre: Vector, arc: Value) -> tuple[Value, Vector]:
        """`nearest` of a sphere, or the tip, that follows the sphere before it on the shaft, in a colon that moves."""
        xp = self.program.xp
        found, rest = self.nearest(centre, arc)
        if not self.axis:
            return found, rest
        *last, upto = self._follows(*centre, arc)
        return threaded_arc(xp, found, upto, norm(xp, minus(centre, (last[0], last[1], last[2])))), rest

    def nearest(self, place: Vector, arc: Value) -> tuple[Value, Vector]:
        """Arc length next to a place that was near `arc`, and where the place stands in the colon at rest."""
        rest = Changing(self.program, place)
        if self.axis:
            near, where = arc > -_BEFORE, self.program.xp.where
            with self.program.when(near):
                found = zip(self.axis.reference(place, arc), place, strict=True)
                rest.now = tuple(where(near, back, still) for back, still in found)
        back: Any = rest.now
        return nearest_arc(self.program.xp, self.tables, *self._stations(), back, arc), back

    def wall(self, rest: Vector, arc: Value, *, near: bool) -> tuple[Value, Vector, Vector, Vector]:
        """Depth of a sphere in the wall, the inward normal, its lever on a colon that moves and that wall's speed.

        Where a sphere does not touch, a bound of its depth may be found, and the rest is of no meaning.

        Args:
            rest: the sphere's middle, in the colon at rest.
            arc: there.
            near: whether depths matter only of spheres that touch; else of all in colons that are fixed.
        """
        xp, radius, stations = self.program.xp, self.scope("radius"), self._stations()
        wider = radius - self.world("device_radius")

        def bound(depth: Value) -> Value:
            depth = xp.where(arc > 0, depth + wider, -1.0)
            return self.axis.most_depth(arc, depth, radius) if self.axis else depth

        most = bound(depth_bound(xp, self.tables, *stations, rest, arc)) if near else self.program.constant(1.0)
        found = Changing(self.program, (most, *_NONE * 3))
        with self.program.when(most > 0):
            depth, normal = wall_beside(xp, self.tables, *stations, rest, arc)
            found.now = bound(depth), *normal, *_NONE * 2
            if self.axis:
                with self.program.when(found.now[0] > 0):
                    depth = xp.where(arc > 0, depth + wider, -1.0)
                    depth, normal, held, leaving = self.axis.touched(arc, rest, depth, normal, radius)
                    found.now = depth, *normal, *held, *leaving
        now: Any = found.now
        return now[0], now[1:4], now[4:7], now[7:]

    def station(self, arc: Value) -> tuple[Vector, Value]:
        """Where the centreline is now at an arc length [m], and how wide the lumen is there [m]."""
        place = axis_point(self.program.xp, self.tables, *self._stations(), arc)
        width = station_width(self.program.xp, self.tables, *self._stations(), arc)
        return add(place, self.axis.moved(arc)) if self.axis else place, width

    def bend(self) -> tuple[Value, Value]:
        """Bend of the bending section towards wires 'up' and 'left' [rad]."""
        up, left = self.program.variable(0.0), self.program.variable(0.0)
        with self.program.loop(0, self.bodies) as body:
            tip = self.program.xp.where(self.of_tip(body), 1.0, 0.0)
            with self.program.loop(*self.hinges_of(body)) as dof:
                angle = tip * self.state.load(dof)
                up.value = up.value + self.joint(dof, "y") * angle
                left.value = left.value - self.joint(dof, "x") * angle
        return up.value, left.value

    def link_force(self, body: Value) -> Value:
        """Resultant of the wall on a link when it was last read off [N]."""
        return self.seen.load(seen_slot("coils") + self.coils * 3 + body)

    def link_arc(self, body: Value) -> Value:
        """Arc length next to the sphere in the middle of a link [m]."""
        first, last = self.spheres_of(body)
        return self.state.load(self.layout.arcs + (first + last) // 2)

    def link_length(self, body: Value) -> Value:
        """To the next link, or to the tip [m]."""
        return self.program.xp.where(body < self.bodies - 1, self.link(body + 1, "offset"), self.scope("tip"))

    def of_tip(self, body: Value) -> Value:
        """Whether a link is of the bending section."""
        return self.structure.load(body * STRUCTURE + 4) > 0

    def length(self) -> Value:
        """Length of the colon's centreline [m]."""
        return self.world("step") * (self.world("count") - 1)

    def _stations(self) -> tuple[Value, Value, Value]:
        whole = self.program.xp.int32
        return self.world("step"), whole(self.world("first")), self.world("count")

    def _inwards(self) -> None:
        program = self.program
        sums = Changing(program, [0.0] * 27)
        pulls = () if self.wires else self._pulls()
        if self.wires:
            self.wires.begin()
        axis = Changing(program, self.links.vector(self.bodies - 1, _DIRECTION))
        with program.loop(0, self.bodies, backwards=True) as body:
            self.links.fetch(body - 2, 0, self.layout.body_numbers)
            self.link_design.fetch(body - 1, 0, len(BODY))
            sums.now = self._with_own(body, axis.now, sums.now)
            axis.now = self._before(body)
            with program.loop(*self.hinges_of(body), backwards=True) as dof:
                self._fetch_joint(dof - 1)
                self.joint_design.fetch(dof - 1, _DRIVEN, len(DOF) - _DRIVEN)
                self.joints.fetch(dof - 1, 7, 3)
                self._free(dof, sums, pulls, hinge_force, 0)
            with program.when(body == 0):
                self._free(program.index(0), sums, pulls, slide_force, 1)
            offset = times(self.link(body, "offset"), axis.now)
            inertia, torque, force = _unflat(sums.now)
            sums.now = (*flat(from_parent(inertia, offset)), *add(torque, cross(offset, force)), *force)
            if self.wires:
                self.wires.shift(offset)
        if self.wires:
            self.wires.pull()

    def _before(self, body: Value) -> Vector:
        """Direction of the link before one."""
        program, first = self.program, body < 1
        before = self.links.vector(program.xp.where(first, body, body - 1), _DIRECTION)
        x, y, z = (program.xp.where(first, *pair) for pair in zip(INWARDS, before, strict=True))
        return x, y, z

    def _with_own(self, body: Value, axis: Vector, sums: tuple[Value, ...]) -> tuple[Value, ...]:
        """Inertia and wrench of the links behind one, and its own, with what its spheres are damped by."""
        program, touches = self.program, self.touches
        wrench = (self.links.load(body, _WRENCH + i) for i in range(6))
        own = *flat(link_inertia(axis, *self._masses(body))), *wrench
        total = Changing(program, [one + more for one, more in zip(sums, own, strict=True)])
        with program.loop(*self.spheres_of(body)) as sphere:
            touches.fetch(sphere - 2, SPRING, 1)
            with program.when(touches.load(sphere, SPRING) > 0):
                normal = touches.vector(sphere, _NORMAL)
                along, across = (self.h * touches.load(sphere, which) for which in (_DAMPER, _DRAG))
                felt = flat(place_inertia(self._lever(sphere, axis, normal), normal, along, across))
                total.now = (*(one + more for one, more in zip(total.now[:21], felt, strict=True)), *total.now[21:])
        return total.now

    def _pulls(self) -> tuple[Value, ...]:
        """What wires bear of the pulls that arrived [N]."""
        limit, arrived = self.scope("pull_limit"), (self.state.load(self.layout.pulls + wire) for wire in range(4))
        return tuple(_borne_pulls(self.program.xp, pull, limit) for pull in arrived)

    def _free(self, dof: Value, sums: Changing, pulls: Any, unit_force: Callable[..., Any], slides: int) -> None:
        """Let a joint give way: what is felt beyond it less what it yields."""
        inertia, torque, force = _unflat(sums.now)
        direction = self.joints.vector(dof, 7)
        turn, push = unit_force(inertia, direction)
        driven, damped = self._driven(dof, pulls, slides)
        inverse = 1.0 / (dot(direction, push if slides else turn) + damped)
        driven = driven - dot(direction, force if slides else torque)
        inertia, turn, push = freed(inertia, turn, push, inverse)
        if self.wires:
            self.wires.free(dof, driven, inverse, (turn, push), slides)
        self.joints.put(dof, 0, (*turn, *push, driven * inverse))
        sums.now = (*flat(inertia), *add(torque, times(driven, turn)), *add(force, times(driven, push)))

    def _fetch_joint(self, dof: Value) -> None:
        self.now.fetch(dof)
        self.now.fetch(self.layout.speeds + dof)

    def _driven(self, dof: Value, pulls: Any, slides: int) -> tuple[Value, Value]:
        """Torque of springs, stops, locks, wires and hand on a joint; and its armature, with what a step is damped."""
        program = self.program
        sprung, damping, armature = self._sprung(dof, pulls)
        total, damped = program.variable(sprung), program.variable(damping)
        with program.when(dof < 2):
            hand, held = self._by_hand(dof, 0 if slides else 1)
            total.value = total.value + hand
            damped.value = damped.value + held
        return total.value, armature + self.h * damped.value

    def _sprung(self, dof: Value, pulls: Any) -> tuple[Value, Value, Value]:
        """Torque of springs, stops, locks and wires on a joint, what damps it, and its armature."""
        xp = self.program.xp
        angle, speed = self.now.load_next(dof), self.now.load_next(self.layout.speeds + dof)
        scale = self.scale(dof)
        damping = scale * self.joint(dof, "damping")
        low, high = self.joint(dof, "low"), self.joint(dof, "high")
        stop, stopped = _stop_torque(xp, angle, low, high, timestep=self.h)
        bent = angle - self.joint(dof, "rest")
        torque = stop - scale * (self.joint(dof, "stiffness") + self.joint(dof, "cubic") * bent**2) * bent
        insertion = self.scope("start") + self.now.load(0)
        held = _lock_activation(xp, insertion, self.joint(dof, "behind"))
        damping = damping + stopped + self.joint(dof, "lock_damping") * held
        torque = torque - self.joint(dof, "lock_stiffness") * held * angle
        for name, pull in zip(WIRE_NAMES, pulls, strict=not self.wires):
            torque = torque - pull * self.joint(dof, name)
        return torque - damping * speed, damping, scale * self.joint(dof, "armature")

    def _by_hand(self, dof: Value, side: int) -> tuple[Value, Value]:
        """Force of the hand along the shaft, or torque about it, and what it damps the shaft by."""
        hand = self._hand(side, self.now.load(dof), self.now.load(self.layout.speeds + dof))
        # The hand's damper is in its force already; where the force is at its limit, it damps no more.
        free = self.program.xp.abs(hand) < self.world(_HAND_LIMITS[side])
        return hand, self.program.xp.where(free, float(HAND_DAMPING[side]), 0.0)

    def _hand(self, side: int, place: Value, speed: Value) -> Value:
        """Force of the hand along the shaft, or torque about it."""
        aim, limit = self.state.load(self.layout.hand + side), self.world(_HAND_LIMITS[side])
        parts = float(HAND_STIFFNESS[side]), float(HAND_DAMPING[side])
        return held_force(self.program.xp, aim, place, speed, limit, *parts)

    def _accelerate(self, fastest: Any) -> None:
        program, joints, layout = self.program, self.joints, self.layout
        turning, moving, axis = (Changing(program, begun) for begun in (_NONE, _NONE, INWARDS))

        def move(dof: Value, along: Changing) -> None:
            self.now.fetch(layout.speeds + dof + 1)
            joints.fetch(dof + 1, 0, JOINT_ROOM)
            gives = dot(joints.vector(dof, 0), turning.now) + dot(joints.vector(dof, 3), moving.now)
            rate = joints.load(dof, 6) - gives
            if self.wires:
                rate = rate - self.wires.bends(dof)
            along.now = add(along.now, times(rate, joints.vector(dof, 7)))
            speed = self.now.load(layout.speeds + dof) + self.h * rate
            if self._turns:
                self._turns.then.store(dof, self.now.load(dof) + self.h * speed)
                self._turns.then.store(layout.speeds + dof, speed)
            else:
                joints.put(dof, _FASTER, (speed,))
            size = program.xp.abs(speed)
            fastest.value = program.xp.where(size < SPEED_LIMIT, fastest.value, size)  # also of what is no number

        with program.loop(0, self.bodies) as body:
            self.links.fetch(body + 1, _DIRECTION, 3)
            self.link_design.fetch(body + 2, 0, 1)
            moving.now = add(moving.now, cross(turning.now, times(self.link(body, "offset"), axis.now)))
            with program.when(body == 0):
                move(program.index(0), moving)
            with program.loop(*self.hinges_of(body)) as dof:
                move(dof, turning)
            axis.now = self.links.vector(body, _DIRECTION)
            self._leave_wall(body, axis.now, turning.now, moving.now)

    def _leave_wall(self, body: Value, axis: Vector, turning_rate: Vector, moving_rate: Vector) -> None:
        """What the spheres of a link do at the step's end, by its direction and its angular and linear acceleration."""
        with self.program.loop(*self.spheres_of(body)) as sphere:
            self._leave(sphere, axis, turning_rate, moving_rate)

    def _leave(self, sphere: Value, axis: Vector, turning_rate: Vector, moving_rate: Vector) -> None:
        """Normal force at the step's end, by the speed at which the surface then leaves the wall."""
        program, touches = self.program, self.touches
        touches.fetch(sphere + 2, SPRING, 1)
        spring = touches.load(sphere, SPRING)
        if self._turns:
            self._turns.then.store(self.layout.normals + sphere, 0.0)
        with program.when(spring > 0):
            normal, speed = touches.vector(sphere, _NORMAL), touches.vector(sphere, _SPEED)
            lever = self._lever(sphere, axis, normal)
            speed = add(speed, times(self.h, add(moving_rate, cross(turning_rate, lever))))
            pressed = normal_force(program.xp, spring, touches.load(sphere, _DAMPER), dot(normal, speed))
            if self.axis:
                self._press_axis(self.axis, sphere, normal, speed)
            if self._turns:
                self._turns.then.store(self.layout.normals + sphere, pressed)
            else:
                touches.put(sphere, SPRING, (pressed,))

    def _press_axis(self, axis: Axis, sphere: Value, normal: Vector, speed: Vector) -> None:
        """What a sphere does to a colon that moves, at the end of the step."""
        where, spring = self.program.xp.where, self.touches.load(sphere, SPRING)
        touching = spring > 0

        def there(v: Vector) -> Vector:
            return where(touching, v[0], 0.0), where(touching, v[1], 0.0), where(touching, v[2], 0.0)

        drag, damper = (where(touching, self.touches.load(sphere, slot), 0.0) for slot in (_DRAG, _DAMPER))
        force = times(-1.0, place_force(spring, damper, drag, there(normal), there(speed)))
        held = there(self.touches.vector(sphere, _HELD))
        axis.press(self.state.load_next(self.layout.arcs + sphere), sphere, Touch(held, force, damper, drag))

    def observe(self) -> None:
        """Read off what there is to see at the end of a control step."""
        program, state, seen = self.program, self.state, self.seen
        force, deepest = Changing(program, _NONE), program.variable(-1.0)
        if self.axis:
            self.axis.shape(self._reached())

        tip = self._look_along(force, deepest)
        frame = tip.frame
        seen.put(seen_slot("tip"), add(tip.place, times(self.scope("tip"), tip.axis)))
        seen.put(seen_slot("tip_frame"), [frame[column][row] for row in range(3) for column in range(3)])
        seen.put(seen_slot("tip_force"), [dot(column, force.now) for column in frame])
        seen.store(seen_slot("deepest"), deepest.value)
        for side, name in enumerate(("push_force", "torque")):
            held = self._hand(side, state.load(side), state.load(self.layout.speeds + side))
            seen.store(seen_slot(name), held)

    def _look_along(self, force: Changing, deepest: Variable) -> "Link":
        """Note links' origins, what presses on them and coils, and add up the force on the tip; the last link."""

        def look(body: Value, link: Link) -> None:
            self.links.put(body, 0, link.place)
            pressed = Changing(self.program, _NONE)

            def feel(more: Vector) -> None:
                pressed.now = add(pressed.now, more)

            with self.program.loop(*self.spheres_of(body)) as sphere:
                middle = add(link.place, times(self.sphere_place(sphere), link.axis))
                self._note_coil(sphere, middle)
                self._press(sphere, middle, deepest, feel)
            self._note_force(body, pressed.now, force)

        self._begin_following()
        return self.chain(look)

    def _note_coil(self, sphere: Value, middle: Vector) -> None:
        coil = self.structure.load(self._scales + self.dofs + sphere)
        with self.program.when(coil >= 0):
            self.seen.put(coil * 3 + seen_slot("coils"), middle)

    def _note_force(self, body: Value, pressed: Vector, force: Changing) -> None:
        self.seen.store(seen_slot("coils") + self.coils * 3 + body, self.program.xp.sqrt(dot(pressed, pressed)))
        with self.program.when(self.of_tip(body)):
            force.now = add(force.now, pressed)

    def _press(self, sphere: Value, middle: Vector, deepest: Variable, feel: Callable[[Vector], None]) -> None:
        """How deep a sphere is, and with what force it presses."""
        program, xp, layout = self.program, self.program.xp, self.layout
        arc, rest = self._followed(middle, self.state.load_next(layout.arcs + sphere))
        arc = self._to_look_up(sphere, arc)
        with program.when(arc > 0):
            depth, normal, _, _ = self.wall(rest, arc, near=False)
            for each in program.apart(depth):
                deepest.value = xp.maximum(deepest.value, each)
            feel(times(xp.where(arc > 0, self.state.load_next(layout.normals + sphere), 0.0), normal))

    def origin(self, body: Any) -> Vector:
        """A link's origin, as `observe` found it last [m]."""
        return self.links.vector(body, 0)

    def _axis(self, dof: Any) -> Vector:
        return self.joint(dof, "x"), self.joint(dof, "y"), self.joint(dof, "z")


class Link:
    """Pose and motion of a link, while the chain is gone through; the first stands still at the entry."""

    def __init__(self, program: Program, falling: Vector) -> None:
        """`falling`: acceleration that keeps a weight up [m/s^2]."""
        self._frame = [Changing(program, [float(i == j) for i in range(3)]) for j in range(3)]
        self._place, self._turning, self._moving, self._turning_rate = (Changing(program, _NONE) for _ in range(4))
        self._moving_rate = Changing(program, falling)

    @property
    def axis(self) -> Vector:
        """Direction of the link."""
        return self._frame[2].now

    @property
    def frame(self) -> tuple[Vector, Vector, Vector]:
        """Its axes."""
        return self._frame[0].now, self._frame[1].now, self._frame[2].now

    @property
    def place(self) -> Vector:
        """Place of its origin [m]."""
        return self._place.now

    @property
    def turning(self) -> Vector:
        """Angular velocity [rad/s]."""
        return self._turning.now

    @property
    def moving(self) -> Vector:
        """Velocity of its origin [m/s]."""
        return self._moving.now

    @property
    def turning_rate(self) -> Vector:
        """Angular acceleration that velocities alone give [rad/s^2]."""
        return self._turning_rate.now

    @property
    def moving_rate(self) -> Vector:
        """Acceleration of the origin, with what keeps it from falling [m/s^2]."""
        return self._moving_rate.now

    def direction(self, local: Vector) -> Vector:
        """Direction of a joint's axis in the world."""
        x, y, z = self.frame
        return add(add(times(local[0], x), times(local[1], y)), times(local[2], z))

    def shift(self, offset: Vector) -> None:
        """To the next link's origin."""
        self._place.now = add(self.place, offset)
        self._moving.now = add(self.moving, cross(self.turning, offset))
        self._moving_rate.now = add(self.moving_rate, cross(self.turning_rate, offset))

    def slide(self, direction: Vector, way: Value, speed: Value) -> None:
        """Along a slide."""
        moved = times(speed, direction)
        self._moving_rate.now = add(self.moving_rate, cross(self.turning, moved))
        self._moving.now = add(self.moving, moved)
        self._place.now = add(self.place, times(way, direction))

    def turn(self, local: Vector, direction: Vector, turned: tuple[Value, Value], speed: Value) -> None:
        """About a hinge, by an angle of that sine and 1 less its cosine."""
        rate = times(speed, direction)
        self._turning_rate.now = add(self.turning_rate, cross(self.turning, rate))
        self._moving_rate.now = add(self.moving_rate, cross(self.moving, rate))
        self._turning.now = add(self.turning, rate)
        frame = turned_frame(self.frame, local, direction, *turned)
        for mine, column in zip(self._frame, frame, strict=True):
            mine.now = column


class HeldOpen:
    """How wide gas holds each world's lumen: `haustra.models.wall.lumen_table.put_distended`, number by number."""

    def __init__(self, program: Program, widths: Lanes, world: Callable[[str], Value]) -> None:
        """Bind widths, a row a station of each world's colon, and the numbers of worlds by name."""
        self._program, self._widths, self._world = program, widths, world
        self._seen: dict[Any, Value] = {}

    def width(self, row: Value) -> Value:
        """Width at a row of the colons' stations, over that of the lumen as it was given [1]."""
        key = self._program.builder.block, row.written
        if key not in self._seen:
            self._seen[key] = self._widths.gather(row - self._program.xp.int32(self._world("first")))
        return self._seen[key]

    def radius(self, row: Value, rest: Value) -> Value:
        """Largest radius of the device's middle at a row, of that at rest [m]."""
        return distended_radius(self._program.xp, rest, self.width(row), self._world("device_radius"))


class _Points:
    """`Tables.points` of rows of stations, and behind them the least radius."""

    def __init__(self, rows: Rows, gas: HeldOpen | None) -> None:
        self._rows, self._gas = rows, gas

    def __getitem__(self, at: tuple[Value, int]) -> Value:
        row, component = at
        number = self._rows.read(row, component)
        return self._gas.radius(row, number) if self._gas and component == LEAST else number


class _Frames:
    """`Tables.frames` of rows of stations."""

    def __init__(self, rows: Rows) -> None:
        self._rows = rows

    def __getitem__(self, at: Any) -> Value:
        row, component, axis = at
        return self._rows.read(row, 4 + 4 * axis + component)


class _Wall:
    """`Tables.wall`."""

    def __init__(self, rows: tuple[Rows, int], gas: HeldOpen | None) -> None:
        self._rows, angles = rows
        self._gas, self.shape = gas, (0, angles, 4)

    def __getitem__(self, at: tuple[Value, Value, int]) -> Value:
        row, angle, part = at
        number = self._rows.read(row * self.shape[1] + angle, part)
        if self._gas and part == 0:
            return self._gas.radius(row, number)
        return self._gas.width(row) * number if self._gas and part == _ALONG else number


def flat(inertia: Inertia) -> tuple[Any, ...]:
    """Its numbers, of which `Layout` keeps wrenches behind."""
    return (*inertia.a, *inertia.b, *inertia.m)


def _unflat(numbers: tuple[Any, ...]) -> tuple[Inertia, Vector, Vector]:
    a, b, m = numbers[:6], numbers[6:15], numbers[15:21]
    torque, force = numbers[21:24], numbers[24:27]
    return Inertia(a, b, m), (torque[0], torque[1], torque[2]), (force[0], force[1], force[2])
