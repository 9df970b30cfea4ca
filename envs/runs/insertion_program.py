"""Insertions within a program of linear time: the follower's rules, scopes' steps, endings and scores in one launch.

Every rule is the function that other backends call: `haustra.envs.control.follower.rules`, the law of
`haustra.envs.runs.measure.containment`, `haustra.envs.runs.outcome.ending` and `haustra.envs.runs.tally.counted`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, Protocol, final, runtime_checkable

import numpy as np
from jaxtyping import Float

from haustra.envs.control.follower import Law, Sensed, Steering, wheel_lead
from haustra.envs.runs.measure.containment import beside, furthest_ahead, skipped_colon, stands_out
from haustra.envs.runs.outcome import ESCAPE_DEPTH, ending, given_up
from haustra.envs.runs.tally import Measured, Tally, counted
from haustra.envs.sim.linear.layout import seen_slot
from haustra.envs.sim.linear.memory import Lanes
from haustra.envs.sim.linear.program import ScopeProgram
from haustra.envs.sim.linear.sensing import (
    hand_lead,
    inserted_length,
    largest_force,
    largest_load,
    largest_pain,
    tip_arc,
)
from haustra.envs.sim.linear.trace import Value
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.wall.vectors import Vector, dot, minus

STATION_STEP = 0.01
"""Distance between the stations at which it is seen whether a scope is outside [m]."""
TOLD = ("time", "insertion", "tip_arc", "push_force", "torque")
"""What is told of each world after every launch, a row each, before what is seen [s, m, m, N, N m]."""
_FAR = 1e3
"""Further out than any scope [m]."""


@runtime_checkable
class Sees(Protocol):
    """What programs look for after each launch, for who decides outside them; those that are equal see alike."""

    @property
    def tells(self) -> int:
        """Numbers of each world that it hands out (`ScopeProgram.told`)."""
        ...

    def write(self, scopes: ScopeProgram, first: int) -> None:
        """Look, and tell, from that row on."""
        ...


@final
@dataclass(frozen=True, kw_only=True)
class InsertionProgram:
    """A driver in a program. Each world has its settings, its memory, its scores, and how far it is outside."""

    law: Law
    """How it drives."""
    straighten: bool
    """`FollowerSettings.straighten`."""
    moves: bool
    """Whether the colons move."""
    steps: int
    """Time steps between two decisions."""
    interval: float
    """Time between them [s]."""
    longest: float
    """The longest colon's centreline is no longer [m]."""
    wheels: bool = False
    """Whether it steers by wheels (`FollowerSettings.steer`)."""
    measures_outside: bool = False
    """Whether how far a scope stands outside the lumen is measured after every decision; otherwise it is bounded, and
    measured only where the bound does not rule out that the scope has left the colon."""
    sees: Sees | None = None
    """What it looks for; nothing where it decides by itself."""

    @property
    def slots(self) -> int:
        """Settings, memory, scores, and how far it is outside."""
        return self._outside_slot + 1

    @property
    def _memory(self) -> int:
        return len(self.law.numbers)

    @property
    def _tally(self) -> int:
        return self._memory + len(self.law.first)

    @property
    def _outside_slot(self) -> int:
        return self._tally + len(Tally._fields)

    @property
    def asks(self) -> int:
        """Nothing comes from outside."""
        return 0

    @property
    def tells(self) -> int:
        """What clinics would record (`TOLD`), and what it sees."""
        return len(TOLD) + (self.sees.tells if self.sees else 0)

    @property
    def room(self) -> int:
        """A place and a width for each station of the longest colon."""
        return 4 * (int(np.ceil(self.longest / STATION_STEP)) + 2)

    def write(self, scopes: ScopeProgram, numbers: Lanes, room: Lanes, count: Value) -> None:
        """So many decisions, steps and scores; worlds that have ended stay as they are."""
        program = scopes.program
        with program.loop(0, count):
            going = (self._ended(numbers) == 0) & (scopes.world("alive") > 0)
            with program.when(going):
                self._interval_of(scopes, numbers, room, going)
        hand = scopes.reading("push_force"), scopes.reading("torque")
        told = scopes.state.load(scopes.layout.time), inserted_length(scopes), tip_arc(scopes), *hand
        for row, value in enumerate(told):
            scopes.told.store(row, value)
        if self.sees:
            self.sees.write(scopes, len(TOLD))

    def _ended(self, numbers: Lanes) -> Value:
        return numbers.load(self._tally + Tally._fields.index("ended"))

    def _interval_of(self, scopes: ScopeProgram, numbers: Lanes, room: Lanes, going: Value) -> None:
        xp = scopes.program.xp
        memory = type(self.law.first)(*(numbers.load(self._memory + slot) for slot in range(len(self.law.first))))
        own = SimpleNamespace(straighten=self.straighten)
        vars(own).update({name: numbers.load(slot) for slot, name in enumerate(self.law.numbers)})
        seen = (self._steering(scopes, own), self._sense(scopes, own.look_ahead)) if self.law.senses else (None, None)
        decision, kept = self.law.rules(xp, own, *seen, memory, interval=self.interval)
        asked = {"push_rate": decision.push_rate, "roll_rate": decision.roll_rate}
        wires = self._travel(scopes, kept) if self.wheels else decision.pulls
        for name, value in (asked | dict(zip(WIRE_NAMES, wires, strict=True))).items():
            scopes.ask(name, value)
        scopes.advance(self.steps, going)
        scopes.observe()
        still = going & (scopes.world("alive") > 0)
        for slot, (new, old) in enumerate(zip(kept, memory, strict=True)):
            numbers.store(self._memory + slot, xp.where(still, new, old))
        self._score(scopes, numbers, room, still, self.law.gives_up(own, kept))

    def _steering(self, scopes: ScopeProgram, own: Any) -> Steering:
        xp = scopes.program.xp
        return Steering(
            pull_per_angle=scopes.scope("pull_per_angle") * scopes.world("tip_bending"),
            pull_limit=scopes.scope("pull_limit"),
            bend_limit=xp.minimum(scopes.scope("bend_limit"), own.steer_limit_deg * (np.pi / 180)),
            lead=own.steer_lead + self._wheel_lead(scopes),
            length=scopes.scope("length"),
        )

    def _wheel_lead(self, scopes: ScopeProgram) -> Any:
        names = "wire_slack", "wire_compliance", "pull_limit", "wire_radius"
        return wheel_lead(*map(scopes.scope, names)) if self.wheels else 0.0

    def _travel(self, scopes: ScopeProgram, kept: Any) -> tuple[Value, ...]:
        """Wire that wheels have taken up for the bend that it steers for [m]."""
        up, left = (scopes.scope("wire_radius") * bend for bend in (kept.bend_up, kept.bend_left))
        return up, left, -up, -left

    def _sense(self, scopes: ScopeProgram, look_ahead: Value) -> Sensed:
        state, layout, seen = scopes.state, scopes.layout, scopes.seen
        arc, (up, left) = tip_arc(scopes), scopes.bend()
        away = minus(scopes.station(arc + look_ahead)[0], seen.vector(seen_slot("tip")))
        frame = [seen.vector(seen_slot("tip_frame") + 3 * row) for row in range(3)]
        ahead: Any = tuple(dot((frame[0][axis], frame[1][axis], frame[2][axis]), away) for axis in range(3))
        wall, tip = largest_force(scopes)
        return Sensed(
            time=state.load(layout.time),
            arc=arc,
            insertion=inserted_length(scopes),
            roll=state.load(1),
            hand_lead=hand_lead(scopes),
            push_force=scopes.reading("push_force"),
            torque=scopes.reading("torque"),
            wall_force=wall,
            tip_force=tip,
            bend=(up, left),
            ahead=ahead,
        )

    def _score(self, scopes: ScopeProgram, numbers: Lanes, room: Lanes, still: Value, gives_up: Value) -> None:
        xp, arc, insertion = scopes.program.xp, tip_arc(scopes), inserted_length(scopes)
        tally = Tally(*(numbers.load(self._tally + slot) for slot in range(len(Tally._fields))))
        outside = self._outside(scopes, room, arc, insertion)
        modelled = scopes.scope("length")
        where = {"arc": arc, "length": scopes.length(), "insertion": insertion, "modelled": modelled}
        ended = ending(xp, outside=outside, skipped=self._skipped(scopes) if self.moves else 0.0, **where)
        ended = given_up(xp, ended, gives_up)
        wall, _ = largest_force(scopes)
        hand = scopes.reading("push_force"), scopes.reading("torque")
        measured = Measured(arc, insertion, *hand, wall, *largest_load(scopes), *largest_pain(scopes))
        for slot, (new, old) in enumerate(zip(counted(xp, tally, measured, ended), tally, strict=True)):
            numbers.store(self._tally + slot, xp.where(still, new, old))
        numbers.store(self._outside_slot, xp.where(still, outside, numbers.load(self._outside_slot)))

    def _outside(self, scopes: ScopeProgram, room: Lanes, arc: Value, insertion: Value) -> Value:
        """How far the scope stands outside the lumen [m], or, where that does not matter, a bound above it."""
        program = scopes.program
        if self.measures_outside:
            return self._measured_outside(scopes, room, arc, insertion)
        found = program.variable(self._outside_bound(scopes, arc, insertion))
        with program.when(found.value > ESCAPE_DEPTH):
            found.value = self._measured_outside(scopes, room, arc, insertion)
        return found.value

    def _outside_bound(self, scopes: ScopeProgram, arc: Value, insertion: Value) -> Value:
        """How far nodes stand outside beside the places where their links' first spheres are; none is nearer there."""
        program, xp = scopes.program, scopes.program.xp
        furthest, behind = program.variable(-_FAR), program.variable(scopes.scope("tip"))
        near = program.variable(arc)

        def judge(place: Vector, at: Value, behind: Value) -> None:
            low, high = beside(xp, arc, behind, moves=self.moves)
            axis, width = scopes.station(at)
            away = minus(place, axis)
            apart = stands_out(xp, dot(away, away), width, scopes.scope("radius"))
            apart = xp.where((at >= low) & (at <= high), apart, _FAR)
            furthest.value = program.xp.where(
                insertion > behind, program.xp.maximum(furthest.value, apart), furthest.value
            )

        judge(scopes.seen.vector(seen_slot("tip")), arc, program.constant(0.0))
        with program.loop(0, scopes.bodies, backwards=True) as body:
            first, last = scopes.spheres_of(body)
            with program.when(first < last):
                near.value = scopes.state.load(scopes.layout.arcs + first)
            judge(scopes.origin(body), near.value, behind.value)
            behind.value = behind.value + scopes.link(body, "offset")
        return furthest.value

    def _measured_outside(self, scopes: ScopeProgram, room: Lanes, arc: Value, insertion: Value) -> Value:
        """How far the scope stands outside the lumen [m]: as `haustra.envs.runs.measure.containment.outside`."""
        program = scopes.program
        xp, last = program.xp, scopes.length()
        ahead = furthest_ahead(arc)
        stations = program.most(xp.int32(xp.clip(ahead, 0.0, last) * (1 / STATION_STEP))) + 2
        with program.loop(0, stations) as station:
            place, width = scopes.station(xp.minimum(program.real_of(station) * STATION_STEP, last))
            room.put(station * 4, (*place, width))
        furthest = program.variable(-_FAR)
        behind = program.variable(scopes.scope("tip"))

        def judge(place: Vector, behind: Value) -> None:
            low, high = beside(xp, arc, behind, moves=self.moves)
            low, high = xp.minimum(low, last), xp.maximum(high, 0.0)
            nearest = program.variable(_FAR)
            first = program.most(xp.int32(xp.maximum(low, 0.0) * (1 / STATION_STEP)), least=True)
            beyond = program.most(xp.int32(xp.minimum(high, last) * (1 / STATION_STEP))) + 2
            with program.loop(first, xp.minimum(beyond, stations)) as station:
                away, at = minus(place, room.vector(station * 4)), program.real_of(station) * STATION_STEP
                apart = stands_out(xp, dot(away, away), room.load(station * 4 + 3), scopes.scope("radius"))
                near = (at >= low) & (at <= high) & (apart < nearest.value)
                nearest.value = xp.where(near, apart, nearest.value)
            inside = (insertion > behind) & (nearest.value < _FAR)
            furthest.value = xp.where(inside, xp.maximum(furthest.value, nearest.value), furthest.value)

        judge(scopes.seen.vector(seen_slot("tip")), program.constant(0.0))
        with program.loop(0, scopes.bodies, backwards=True) as body:
            with program.when(insertion > behind.value):
                judge(scopes.origin(body), behind.value)
            behind.value = behind.value + scopes.link(body, "offset")
        return furthest.value

    def _skipped(self, scopes: ScopeProgram) -> Value:
        """The most colon between neighbouring spheres past the anus (`skipped_colon`) [m]."""
        program, xp = scopes.program, scopes.program.xp
        most, before, place = program.variable(0.0), program.variable(0.0), program.variable(0.0)
        with program.loop(0, scopes.bodies) as body:
            place.value = place.value - scopes.link(body, "offset")
            with program.loop(*scopes.spheres_of(body)) as sphere:
                arc, own = scopes.state.load(scopes.layout.arcs + sphere), scopes.sphere_place(sphere)
                found = skipped_colon(arc, before.value, own - place.value)
                most.value = xp.maximum(most.value, xp.where(before.value > 0, found, 0.0))
                before.value, place.value = arc, own
        return most.value

    # What worlds are given, and what is kept of them.

    def numbers_of(self, settings: Sequence[Any], start: Any) -> np.ndarray:
        """Numbers of worlds that have not begun, whose tips start so deep [m]: one number, or one a world."""
        tally = [0.0] * len(Tally._fields)
        rows = np.array(
            [[*map(own.__getattribute__, self.law.numbers), *self.law.first, *tally, -_FAR] for own in settings]
        )
        rows[:, self._tally] = start
        return rows

    def slot_of(self, score: str) -> int:
        """Where a score of a world is, by its name in `Tally`."""
        return self._tally + Tally._fields.index(score)

    def tally_of(self, numbers: Float[np.ndarray, "*worlds slots"]) -> Tally:
        """Scores of each world."""
        return Tally(*numbers[..., self._tally : self._outside_slot].T)

    def memory_of(self, numbers: Float[np.ndarray, "worlds slots"]) -> Any:
        """Each world's memory."""
        return type(self.law.first)(*numbers[:, self._memory : self._tally].T)

    def outside_of(self, numbers: Float[np.ndarray, "worlds slots"]) -> Float[np.ndarray, " worlds"]:
        """How far each scope stood outside the lumen at last [m]."""
        return numbers[:, self._outside_slot]
