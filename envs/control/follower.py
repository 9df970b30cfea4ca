"""A lumen follower: drives scopes without a human, by the lumen's axis ahead of the tip.

It knows the centreline and the wall forces, which a real device does not: a baseline and a demonstration, not a rival
to a policy that sees only what a camera shows. Its rules are one function of (xp, …) for any number of worlds, in
numpy, in JAX, and in programs that step scopes in linear time.
"""

import math
from dataclasses import dataclass, fields
from types import ModuleType
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.envs.sim.state import Controls, Readings
from haustra.fields import number, require_declared
from haustra.models.anatomy.colon import Centreline
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.wall import vectors
from haustra.models.wall.vectors import Vector

STEP_FORWARD = 0.003
"""Gain in arc length that counts as progress [m]; engineering choice above the centreline's spacing of 2 mm."""


LEAST_RETREAT = 0.03
"""A retreat that straightens goes at least this far [m]: sooner, a slip of the tip says nothing."""
_FIRST_WAIT = 0.5
"""It does not back off within this after its last progress [s]."""
_NEVER = -1e3
"""A length that stands for none yet [m]."""
_TINY = 1e-12
"""Keeps lengths of vectors from being zero where they divide."""


@dataclass(frozen=True)
class FollowerSettings:
    """How the follower drives. Engineering choices, tuned on grown colons."""

    look_ahead: float = number("m", 0.005, 0.5, default=0.045)
    """Distance ahead of the tip of the place on the centreline that it is steered towards [m]."""
    advance_rate: float = number("m/s", 1e-4, 1.0, default=0.04)
    """Insertion speed in free lumen [m/s]."""
    retreat_rate: float = number("m/s", 1e-4, 1.0, default=0.06)
    """Withdrawal speed when backing off [m/s]."""
    retreat_distance: float = number("m", 0.001, 2.0, default=0.05)
    """Distance that the scope is backed off [m]; each further attempt at the same place goes back further."""
    steer_gain: float = number("1/s", 0.0, 100.0, default=3.0)
    """Bending rate per angle off the lumen's axis [1/s]."""
    steer_limit_deg: float = number("degrees", 1.0, 360.0, default=110.0)
    """Largest angle that the tip is bent to while pushing [degrees]: a tip bent further is pushed sideways, not on."""
    steer_lead: float = number("rad", 0.01, 10.0, default=0.6)
    """Largest lead of the wires over the angle that the bending section has reached [rad]."""
    tip_force_limit: float = number("N", 0.01, 1e4, default=12.0)
    """Wall force on the bending section at which the follower backs off [N]."""
    wall_force_limit: float = number("N", 0.01, 1e4, default=25.0)
    """Wall force on any link at which the follower backs off [N]."""
    push_force_limit: float = number("N", 0.01, 1e4, default=35.0)
    """Push force at which the follower backs off [N]."""
    roll_step: float = number("rad", 0.0, 2 * math.pi, default=math.radians(60))
    """Angle that the shaft is turned through after backing off [rad]."""
    roll_rate: float = number("rad/s", 0.01, 50.0, default=math.radians(90))
    """Rate at which the shaft is turned [rad/s]."""
    hand_lead_limit: float = number("m", 1e-4, 0.1, default=0.01)
    """Largest distance that the hand aims ahead of where the shaft is [m]."""
    steer: Literal["pulls", "wheels"] = "pulls"
    """What the tip is steered by: pulls of wires that are known to be right, or wheels, which the wires follow as they
    can."""
    patience: float = number("s", 0.01, 600.0, default=4.0)
    """Time without progress after which the follower backs off [s]."""
    straighten: bool = False
    """Back off as endoscopists do: go on pulling while the hooked tip holds, so that a colon that may move is gathered
    on the shaft and straightened, and stop when the tip slips. For colons on their mesentery."""
    straighten_distance: float = number("m", 0.001, 2.0, default=0.35)
    """Largest distance that the scope is backed off to straighten the colon [m]."""
    slip: float = number("m", 1e-4, 1.0, default=0.02)
    """Loss of arc length after which the tip counts as slipping [m]."""

    def __post_init__(self) -> None:
        require_declared(self, "The follower")

    @classmethod
    def law(cls) -> "Law":
        """What drives by these settings."""
        return Law(cls, FIRST_MEMORY, rules)


class Steering(NamedTuple):
    """What the follower must know of the scopes that it steers: numbers, or one a world."""

    pull_per_angle: Any
    """Pull of a wire per bend of the bending section [N/rad]."""
    pull_limit: Any
    """Largest pull of a wire [N]."""
    bend_limit: Any
    """Largest bend that it steers for [rad]."""
    lead: Any
    """Largest lead of the bend steered for over the bend that is there [rad]."""
    length: Any
    """How much of the scope there is to push in [m]."""

    @classmethod
    def of(cls, design: ScopeDesign, settings: Any) -> "Steering":
        """Read off a design how it is steered."""
        lead = settings.steer_lead
        if settings.steer == "wheels":  # what slack and stretch may take up counts as lead
            wires = design.wires
            lead += wheel_lead(wires.slack, wires.compliance, wires.pull_limit, wires.routing_radius)
        return cls(
            pull_per_angle=design.pull_per_angle,
            pull_limit=design.wires.pull_limit,
            bend_limit=math.radians(min(design.limits.smallest, settings.steer_limit_deg)),
            lead=lead,
            length=design.length,
        )


def wheel_lead(slack: Any, compliance: Any, pull_limit: Any, routing_radius: Any) -> Any:
    """Bend that slack [m] and stretch [m/N] of wires, under their largest pull [N], may take up at most [rad]."""
    return (slack + compliance * pull_limit) / routing_radius


class Memory(NamedTuple):
    """What the follower remembers; leading axis: worlds."""

    bend_up: Float[Any, "*worlds"]
    """Bend that it steers for, towards wire 'up', as ideal wires would give it [rad]."""
    bend_left: Float[Any, "*worlds"]
    """Bend that it steers for, towards wire 'left' [rad]."""
    best_arc: Float[Any, "*worlds"]
    """Largest arc length of the tip so far [m]."""
    local_arc: Float[Any, "*worlds"]
    """Largest arc length of the tip since it last went back [m]."""
    local_time: Float[Any, "*worlds"]
    """When that was reached [s]."""
    retreat_until: Float[Any, "*worlds"]
    """Insertion at which it goes on again [m]; negative while it does not retreat."""
    retreat_from: Float[Any, "*worlds"]
    """Insertion at which it began to retreat [m]."""
    held_arc: Float[Any, "*worlds"]
    """Largest arc length of the tip since [m]."""
    roll_goal: Float[Any, "*worlds"]
    """Angle to which it turns the handle [rad]."""
    attempts: Float[Any, "*worlds"]
    """Times that it backed off since the last progress."""


def never(settings: Any, memory: Any) -> Any:
    """Whether those who remember so much give up, where nobody does."""
    return memory.attempts < 0


class Law(NamedTuple):
    """A way to drive: one function of (xp, …) for any number of worlds, in numpy, JAX and programs."""

    settings: type
    """Type of its settings, which have `law`; numbers of them may differ from world to world."""
    first: Any
    """What a driver remembers that has seen nothing yet: a tuple of numbers with `attempts`, and with `bend_up` and
    `bend_left` where it steers by wheels."""
    rules: Any
    """`rules(xp, settings, steering, sensed, memory, interval=…)`: a `Decision`, and what is remembered."""
    senses: bool = True
    """Whether it decides by what it senses; rules get None for `steering` and `sensed` where it does not."""
    gives_up: Any = never
    """`gives_up(settings, memory)`: whether those who remember so much end the run."""

    @property
    def numbers(self) -> tuple[str, ...]:
        """Settings that are numbers of each world."""
        return tuple(field.name for field in fields(self.settings) if field.name not in ("steer", "straighten"))

    def begin(self, xp: ModuleType, worlds: int, kind: Any) -> Any:
        """Memory of drivers that have seen nothing yet, in that precision."""
        return type(self.first)(*(xp.full(worlds, value, kind) for value in self.first))


FIRST_MEMORY = Memory(0.0, 0.0, _NEVER, _NEVER, 0.0, _NEVER, _NEVER, _NEVER, 0.0, 0.0)
"""Memory of a follower that has seen nothing yet."""


class Sensed(NamedTuple):
    """What the follower decides by; leading axis: worlds."""

    time: Float[Any, "*worlds"]
    """[s]."""
    arc: Float[Any, "*worlds"]
    """Arc length of the tip [m]."""
    insertion: Float[Any, "*worlds"]
    """Length past the anus [m]."""
    roll: Float[Any, "*worlds"]
    """Angle of the handle [rad]."""
    hand_lead: Float[Any, "*worlds"]
    """How far the hand aims ahead of the shaft [m]."""
    push_force: Float[Any, "*worlds"]
    """[N]."""
    torque: Float[Any, "*worlds"]
    """Torque of the hand [N m]."""
    wall_force: Float[Any, "*worlds"]
    """Largest resultant wall force on one link [N]."""
    tip_force: Float[Any, "*worlds"]
    """Largest resultant wall force on one link of the bending section [N]."""
    bend: tuple[Any, Any]
    """Bend of the bending section, towards wires 'up' and 'left' [rad]."""
    ahead: Vector
    """From the tip to the place that it steers for, in the tip's own axes [m]."""


class Decision(NamedTuple):
    """What the follower asks for until it is asked again; leading axis: worlds."""

    push_rate: Float[Any, "*worlds"]
    """Speed at which the hand pushes the shaft in [m/s]."""
    roll_rate: Float[Any, "*worlds"]
    """Speed at which the hand turns the shaft [rad/s]."""
    pulls: Any
    """Pull of each wire that bends an ideal scope as asked: up, left, down, right [N]."""


def decide(
    xp: ModuleType,
    settings: Any,
    steering: Steering,
    seen: Any,
    memory: Any,
    *,
    time: Float[Any, " worlds"],
    arc: Float[Any, " worlds"],
    target: Float[Any, "worlds 3"],
    interval: float,
    tip_links: int,
) -> tuple[Decision, Any]:
    """What the law of the settings decides in many worlds; pulls have the shape (worlds, 4).

    Args:
        xp: numpy or jax.numpy.
        settings: how it drives.
        steering: the scopes that it steers.
        seen: readings of all worlds: insertion, roll, hand_lead, tip, tip_frame, bend, push_force, torque,
            link_forces, as in `haustra.envs.sim.state.Readings`.
        memory: what it remembers.
        time: simulated time [s].
        arc: arc length of the tip [m].
        target: place of the centreline `settings.look_ahead` ahead of the tip, as the tip's own place is given [m].
        interval: time to the next decision [s].
        tip_links: links of the bending section, the last ones.
    """
    sensed = Sensed(
        time=time,
        arc=arc,
        insertion=seen.insertion,
        roll=seen.roll,
        hand_lead=seen.hand_lead,
        push_force=seen.push_force,
        torque=seen.torque,
        wall_force=seen.link_forces.max(axis=1),
        tip_force=seen.link_forces[:, -tip_links:].max(axis=1),
        bend=(seen.bend[:, 0], seen.bend[:, 1]),
        ahead=vectors.of(xp.einsum("wij,wi->wj", seen.tip_frame, target - seen.tip)),
    )
    decision, kept = settings.law().rules(xp, settings, steering, sensed, memory, interval=interval)
    kept = type(memory)(*(new.astype(old.dtype) for new, old in zip(kept, memory, strict=True)))
    return decision._replace(pulls=xp.stack(decision.pulls, axis=-1)), kept


def rules(
    xp: Any, settings: Any, steering: Steering, sensed: Sensed, memory: Memory, *, interval: float
) -> tuple[Decision, Memory]:
    """Push, steer along the lumen ahead, rotate, back off when the wall force rises.

    Args:
        xp: numpy, jax.numpy, or what writes programs.
        settings: how it drives: `FollowerSettings`, or numbers by its names.
        steering: the scopes that it steers.
        sensed: what it decides by.
        memory: what it remembers.
        interval: time to the next decision [s].
    """
    own = settings
    up, left = steer_ahead(xp, own, steering, sensed, memory, interval)
    time, arc, insertion = sensed.time, sensed.arc, sensed.insertion
    forward, further = arc > memory.local_arc + STEP_FORWARD, arc > memory.best_arc + STEP_FORWARD
    local_arc, local_time = xp.where(forward, arc, memory.local_arc), xp.where(forward, time, memory.local_time)
    best = xp.where(further, arc, memory.best_arc)
    attempts = xp.where(further, 0.0, memory.attempts)
    wall, tip = sensed.wall_force / own.wall_force_limit, sensed.tip_force / own.tip_force_limit
    load = xp.maximum(xp.maximum(tip, wall), sensed.push_force / own.push_force_limit)
    waiting = time - local_time
    back = (memory.retreat_until < 0) & (waiting > _FIRST_WAIT) & ((load > 1) | (waiting > own.patience))
    attempts = xp.where(back, attempts + 1, attempts)
    far = own.straighten_distance if own.straighten else own.retreat_distance * xp.minimum(attempts, 4.0)
    until = xp.where(back, xp.maximum(insertion - far, 0.02), memory.retreat_until)
    begun = xp.where(back, insertion, memory.retreat_from)
    held = xp.maximum(xp.where(back, arc, memory.held_arc), arc)
    # Alternate: a turn one way, twice back, and so on, so that the shaft does not wind up.
    half, twice = xp.floor((attempts + 1) / 2), xp.floor(attempts / 2) * 2
    turn = own.roll_step * half * xp.where(attempts == twice, 1.0, -1.0)
    roll_goal = xp.where(back, turn, memory.roll_goal)
    over = insertion <= until
    rate_back = -own.retreat_rate
    if own.straighten:
        slipped = (arc < held - own.slip) | (insertion <= arc)
        over = over | (slipped & (insertion <= begun - LEAST_RETREAT))
        spare = 1 - xp.maximum(wall, -sensed.push_force / own.push_force_limit)
        rate_back = rate_back * xp.clip(2 * spare, 0.0, 1.0)
    done = (until >= 0) & over
    until = xp.where(done, _NEVER, until)
    local_arc, local_time = xp.where(done, arc, local_arc), xp.where(done, time, local_time)
    rate = own.advance_rate * xp.clip(2 * (1 - load), 0.15, 1.0)
    # The hand never aims far beyond where the shaft is: the push would only build up.
    rate = xp.minimum(rate, (own.hand_lead_limit - sensed.hand_lead) / interval)
    decision = Decision(
        push_rate=xp.where(until >= 0, rate_back, rate),
        roll_rate=xp.clip((roll_goal - sensed.roll) / interval, -own.roll_rate, own.roll_rate),
        pulls=pulls_for(xp, steering, up, left),
    )
    return decision, Memory(up, left, best, local_arc, local_time, until, begun, held, roll_goal, attempts)


def steer_ahead(xp: Any, own: Any, steering: Steering, sensed: Sensed, memory: Any, interval: float) -> tuple[Any, Any]:
    """Bend that it steers for from now on."""
    x, y, z = sensed.ahead
    sideways = _length(xp, x, y)
    turn = own.steer_gain * interval * xp.arctan2(sideways, z) / sideways
    up, left = (
        xp.clip(bend + turn * away, there - steering.lead, there + steering.lead)
        for bend, away, there in zip((memory.bend_up, memory.bend_left), (x, y), sensed.bend, strict=True)
    )
    share = xp.minimum(steering.bend_limit / _length(xp, up, left), 1.0)
    return up * share, left * share


def _length(xp: Any, x: Any, y: Any) -> Any:
    return xp.sqrt((x + _TINY) ** 2 + (y + _TINY) ** 2)


def pulls_for(xp: Any, steering: Steering, up: Any, left: Any) -> tuple[Any, Any, Any, Any]:
    """Pull of each wire that bends an ideal scope so far [N]: up, left, down, right."""
    up, left, most = steering.pull_per_angle * up, steering.pull_per_angle * left, steering.pull_limit
    return xp.clip(up, 0.0, most), xp.clip(left, 0.0, most), xp.clip(-up, 0.0, most), xp.clip(-left, 0.0, most)


class LumenFollower:
    """A follower of one scope in one colon."""

    def __init__(self, line: Centreline, design: ScopeDesign, *, tip_links: int, settings: Any = None) -> None:
        """Get to know the lumen's axis and the scope's wires; its last `tip_links` links are the bending section.

        It drives by the law of its settings, the follower's own when they are None.
        """
        self.settings = settings or FollowerSettings()
        self._line, self._tip_links, self._wires = line, tip_links, design.wires
        self._steering = Steering.of(design, self.settings)
        self.memory = self.settings.law().begin(np, 1, np.float64)
        """What it remembers."""

    def act(self, seen: Readings, arc: float, interval: float) -> Controls:
        """Inputs for the next `interval` [s], given what was seen and the tip's arc length [m]."""
        decision, self.memory = decide(
            np,
            self.settings,
            self._steering,
            one_world(seen),
            self.memory,
            time=np.array([seen.time]),
            arc=np.array([arc]),
            target=self._ahead(seen, arc)[None],
            interval=interval,
            tip_links=self._tip_links,
        )
        push_rate, roll_rate = float(decision.push_rate[0]), float(decision.roll_rate[0])
        if self.settings.steer == "wheels":
            return Controls(push_rate, roll_rate, wheels=self._wires.routing_radius * self.asked)
        return Controls(push_rate, roll_rate, decision.pulls[0])

    @property
    def asked(self) -> Float[np.ndarray, "2"]:
        """Bend that it steers for, towards wires 'up' and 'left', as ideal wires would give it [rad]."""
        return np.array([self.memory.bend_up[0], self.memory.bend_left[0]])

    @property
    def attempts(self) -> int:
        """Times that it backed off since the last progress."""
        return int(self.memory.attempts[0])

    @property
    def gives_up(self) -> bool:
        """Whether it ends the run, having tried what it can."""
        return bool(self.settings.law().gives_up(self.settings, self.memory)[0])

    def _ahead(self, seen: Readings, arc: float) -> Float[np.ndarray, "3"]:
        """Place of the centreline that it steers towards, where it is now [m]."""
        points = self._line.points if seen.way is None else seen.way
        place = arc + self.settings.look_ahead
        return np.array([np.interp(place, self._line.arc, points[:, axis]) for axis in range(3)])


def one_world(seen: Readings) -> Readings:
    """What every backend measures of one scope, as of one world of many."""
    needed = (name for name in Readings._fields if name not in Readings._field_defaults)
    return Readings(**{name: np.asarray(getattr(seen, name))[None] for name in needed})
