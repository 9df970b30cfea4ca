"""The lumen follower for many worlds at once, in JAX.

The decisions of `haustra.envs.control.follower`, without branches.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import jax.numpy as jnp

from haustra.envs.control.follower import LEAST_RETREAT, STEP_FORWARD, FollowerSettings
from haustra.envs.sim import moving_colon
from haustra.envs.sim.precision import precise
from haustra.envs.sim.scope_values import Controls, Parameters, Readings
from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.wall.lumen_table import Tables

Array: TypeAlias = Any
_FIRST_WAIT = 0.5
"""It does not back off within this after its last progress [s]."""


class Drive(NamedTuple):
    """What the follower remembers; leading axis: worlds."""

    bend: Array
    """(worlds, 2): bend that it steers for [rad]."""
    best_arc: Array
    local_arc: Array
    local_time: Array
    retreat_until: Array
    """Insertion at which it goes on again [m]; negative while it does not retreat."""
    retreat_from: Array
    """Insertion at which it began to retreat [m]."""
    held_arc: Array
    """Largest arc length of the tip since [m]."""
    roll_goal: Array
    attempts: Array
    """Times that it backed off since the last progress."""


class Wires(NamedTuple):
    """What the follower knows of the wires of each world's scope; leading axis: worlds, or 1."""

    pull_per_angle: Array
    """Pull of a wire per bend of the bending section [N/rad]."""
    pull_limit: Array
    """Largest pull of one wire [N]."""
    bend_limit: Array
    """Smallest of the bending section's limits [rad]."""

    @classmethod
    def of(cls, design: ScopeDesign) -> "Wires":
        """Wires that all worlds share."""
        numbers = (design.pull_per_angle, design.wires.pull_limit, math.radians(design.limits.smallest))
        return cls(*(jnp.full(1, number, jnp.float32) for number in numbers))


@dataclass(frozen=True)
class WorldsFollower:
    """Push, steer along the lumen ahead, rotate, back off when the wall force rises.

    Raises:
        InvalidOptionError: when it is to steer by wheels.
    """

    settings: FollowerSettings
    tip_links: int
    """Links of the bending section, the last ones."""

    def __post_init__(self) -> None:
        if self.settings.steer != "pulls":
            raise InvalidOptionError("Many worlds are steered by pulls; steering by wheels needs the native engine.")

    def begin(self, worlds: int, kind: Any = jnp.float32) -> Drive:
        """Nothing seen yet."""
        zero = jnp.zeros(worlds, kind)
        never = jnp.full(worlds, -1e3, kind)
        none = jnp.zeros(worlds, jnp.int32)
        return Drive(jnp.zeros((worlds, 2), kind), never, never, zero, never, never, never, zero, none)

    def act(
        self, parameters: Parameters, tables: Tables, seen: Readings, time: Array, drive: Drive, *, interval: float
    ) -> tuple[Controls, Drive]:
        """Inputs for the next `interval` [s].

        Args:
            parameters: of the worlds.
            tables: of each world's colon (`pick`).
            seen: what was seen.
            time: simulated time of each world [s].
            drive: what it remembers.
            interval: time to the next decision [s].
        """
        scope = parameters.scope
        wires = Wires(scope.pull_per_angle * parameters.tip_bending, scope.pull_limit, scope.bend_limit)
        return self.decide(wires, tables, seen, time, drive, interval=interval)

    @precise
    def decide(
        self, wires: Wires, tables: Tables, seen: Readings, time: Array, drive: Drive, *, interval: float
    ) -> tuple[Controls, Drive]:
        """As `act`, given the wires."""
        own, arc = self.settings, seen.tip_arc
        bend = self._steer(wires, tables, seen, drive.bend, interval)
        forward = arc > drive.local_arc + STEP_FORWARD
        local_arc = jnp.where(forward, arc, drive.local_arc)
        local_time = jnp.where(forward, time, drive.local_time)
        further = arc > drive.best_arc + STEP_FORWARD
        best = jnp.where(further, arc, drive.best_arc)
        attempts = jnp.where(further, 0, drive.attempts)
        load = self._load(seen)
        waiting = time - local_time
        retreating = drive.retreat_until >= 0
        back = ~retreating & (waiting > _FIRST_WAIT) & ((load > 1) | (waiting > own.patience))
        attempts = jnp.where(back, attempts + 1, attempts)
        far = own.straighten_distance if own.straighten else own.retreat_distance * jnp.minimum(attempts, 4)
        until = jnp.where(back, jnp.maximum(0.02, seen.insertion - far), drive.retreat_until)
        begun = jnp.where(back, seen.insertion, drive.retreat_from)
        held = jnp.maximum(jnp.where(back, arc, drive.held_arc), arc)
        sign = jnp.where(attempts % 2 == 0, 1.0, -1.0)
        roll_goal = jnp.where(back, own.roll_step * ((attempts + 1) // 2) * sign, drive.roll_goal)
        done = (until >= 0) & ((seen.insertion <= until) | self._slipped(seen, begun, held))
        until = jnp.where(done, -1e3, until)
        local_arc, local_time = jnp.where(done, arc, local_arc), jnp.where(done, time, local_time)
        rate = own.advance_rate * jnp.clip(2 * (1 - load), 0.15, 1.0)
        rate = jnp.minimum(rate, (own.hand_lead_limit - seen.hand_lead) / interval)
        rate = jnp.where(until >= 0, self._retreat_rate(seen), rate)
        roll_rate = jnp.clip((roll_goal - seen.roll) / interval, -own.roll_rate, own.roll_rate)
        up, left = (bend * wires.pull_per_angle[:, None]).T
        pulls = jnp.clip(jnp.stack([up, left, -up, -left], axis=-1), 0.0, wires.pull_limit[:, None])
        kept = (bend, best, local_arc, local_time, until, begun, held, roll_goal)
        return Controls(rate, roll_rate, pulls), Drive(*(new.astype(bend.dtype) for new in kept), attempts=attempts)

    def _steer(self, wires: Wires, tables: Tables, seen: Readings, bend: Array, interval: float) -> Array:
        own = self.settings
        target = moving_colon.axis_at(tables, seen.shift, (seen.tip_arc + own.look_ahead)[:, None])[:, 0]
        ahead = jnp.einsum("wij,wi->wj", seen.tip_frame, target - seen.tip)
        sideways = jnp.linalg.norm(ahead[:, :2] + 1e-9, axis=-1)
        turn = own.steer_gain * interval * jnp.arctan2(sideways, ahead[:, 2]) / sideways
        bend = bend + turn[:, None] * ahead[:, :2]
        bend = jnp.clip(bend, seen.bend - own.steer_lead, seen.bend + own.steer_lead)
        size = jnp.linalg.norm(bend + 1e-12, axis=-1, keepdims=True)
        most = jnp.minimum(wires.bend_limit, math.radians(own.steer_limit_deg))[:, None]
        return bend * jnp.minimum(1.0, most / size)

    def _slipped(self, seen: Readings, begun: Array, held: Array) -> Array | bool:
        own = self.settings
        if not own.straighten:
            return False
        slipped = (seen.tip_arc < held - own.slip) | (seen.insertion <= seen.tip_arc)
        return slipped & (seen.insertion <= begun - LEAST_RETREAT)

    def _retreat_rate(self, seen: Readings) -> Array | float:
        own = self.settings
        if not own.straighten:
            return -own.retreat_rate
        wall = seen.link_forces.max(axis=1) / own.wall_force_limit
        return -own.retreat_rate * jnp.clip(2 * (1 - jnp.maximum(wall, -seen.push_force / own.push_force_limit)), 0, 1)

    def _load(self, seen: Readings) -> Array:
        """The largest force over its limit."""
        own = self.settings
        tip = seen.link_forces[:, -self.tip_links :].max(axis=1) / own.tip_force_limit
        wall = seen.link_forces.max(axis=1) / own.wall_force_limit
        return jnp.maximum(jnp.maximum(tip, wall), seen.push_force / own.push_force_limit)
