"""A lumen follower: drives a scope without a human, by the lumen's axis ahead of the tip.

It knows the centreline and the wall forces, which a real device does not: a baseline and a demonstration, not a rival
to a policy that sees only what a camera shows.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from haustra.envs.sim.native import Inputs, Observation
from haustra.models.anatomy.colon import Centreline
from haustra.models.devices.scope.design import ScopeDesign

STEP_FORWARD = 0.003
"""Gain in arc length that counts as progress [m]; engineering choice above the centreline's spacing of 2 mm."""


LEAST_RETREAT = 0.03
"""A retreat that straightens goes at least this far [m]: sooner, a slip of the tip says nothing."""


@dataclass(frozen=True)
class FollowerSettings:
    """How the follower drives. Engineering choices, tuned on grown colons."""

    look_ahead: float = 0.045
    """It steers towards the centreline this far ahead of the tip [m]."""
    advance_rate: float = 0.04
    """Insertion speed in free lumen [m/s]."""
    retreat_rate: float = 0.06
    """Withdrawal speed when backing off [m/s]."""
    retreat_distance: float = 0.05
    """How far it backs off [m]; each further attempt at the same place goes back further."""
    steer_gain: float = 3.0
    """Bending rate per angle off the lumen's axis [1/s]."""
    steer_limit_deg: float = 110.0
    """Largest angle that it bends the tip to while pushing [degrees]: a tip bent further is pushed sideways, not on."""
    steer_lead: float = 0.6
    """Largest lead of the wires over the angle that the bending section has reached [rad]."""
    tip_force_limit: float = 12.0
    """Wall force on the bending section at which it backs off [N]."""
    wall_force_limit: float = 25.0
    """Wall force on any link at which it backs off [N]."""
    push_force_limit: float = 35.0
    """Push force at which it backs off [N]."""
    roll_step: float = math.radians(60)
    """How far it turns the shaft after backing off [rad]."""
    roll_rate: float = math.radians(90)
    """How fast it turns the shaft [rad/s]."""
    hand_lead_limit: float = 0.01
    """How far the hand aims beyond where the shaft is [m]."""
    steer: Literal["pulls", "wheels"] = "pulls"
    """What it steers by: pulls of wires that it knows to be right, or wheels, which the wires follow as they can."""
    patience: float = 4.0
    """Time without progress after which it backs off [s]."""
    straighten: bool = False
    """Back off as endoscopists do: go on pulling while the hooked tip holds, so that a colon that may move is gathered
    on the shaft and straightened, and stop when the tip slips. For colons on their mesentery."""
    straighten_distance: float = 0.35
    """How far it then backs off at most [m]."""
    slip: float = 0.02
    """Loss of arc length after which the tip counts as slipping [m]."""


class LumenFollower:
    """Push, steer along the lumen ahead, rotate, back off when the wall force rises."""

    def __init__(
        self, line: Centreline, design: ScopeDesign, *, tip_links: int, settings: FollowerSettings | None = None
    ) -> None:
        """Get to know the lumen's axis and the scope's wires; its last `tip_links` links are the bending section."""
        self.settings = settings or FollowerSettings()
        self._line = line
        self._tip_links = tip_links
        self._pull_per_angle = design.pull_per_angle
        self._wires = design.wires
        lead = self.settings.steer_lead
        if self.settings.steer == "wheels":  # what slack and stretch may take up counts as lead
            lead += (
                design.wires.slack + design.wires.compliance * design.wires.pull_limit
            ) / design.wires.routing_radius
        self._lead = lead
        self._bend_limit = math.radians(min(design.limits.smallest, self.settings.steer_limit_deg))
        self._roll_goal = 0.0
        self._bend = np.zeros(2)
        self._best_arc = self._local_arc = -math.inf
        self._local_time = 0.0
        self._retreat_until: float | None = None
        self._retreat_from = self._held_arc = -math.inf
        self.attempts = 0
        """Times that it backed off since the last progress."""

    def act(self, seen: Observation, arc: float, interval: float) -> Inputs:
        """Inputs for the next `interval` [s], given what was seen and the tip's arc length [m]."""
        self._steer(seen, arc, interval)
        if arc > self._local_arc + STEP_FORWARD:
            self._local_arc, self._local_time = arc, seen.time
        if arc > self._best_arc + STEP_FORWARD:
            self._best_arc, self.attempts = arc, 0
        if self._retreat_until is None and self._should_back_off(seen):
            self._begin_retreat(seen, arc)
        if self._retreat_until is not None and self._retreat_over(seen, arc, self._retreat_until):
            self._retreat_until, self._local_arc, self._local_time = None, arc, seen.time
        push_rate = self._advance_rate(seen, interval) if self._retreat_until is None else self._retreat_rate(seen)
        turn = self.settings.roll_rate
        roll_rate = float(np.clip((self._roll_goal - seen.roll) / interval, -turn, turn))
        if self.settings.steer == "wheels":
            return Inputs(push_rate, roll_rate, wheels=self._wires.routing_radius * self._bend)
        return Inputs(push_rate, roll_rate, self._pulls())

    @property
    def asked(self) -> Float[np.ndarray, "2"]:
        """Bend that it steers for, towards wires 'up' and 'left', as ideal wires would give it [rad]."""
        return self._bend.copy()

    def _steer(self, seen: Observation, arc: float, interval: float) -> None:
        station = np.searchsorted(self._line.arc, arc + self.settings.look_ahead)
        way = self._line.points if seen.way is None else seen.way
        target = way[min(station, len(way) - 1)]
        ahead = seen.tip_frame.T @ (target - seen.tip)
        sideways = np.linalg.norm(ahead[:2])
        if sideways > 0:
            angle = math.atan2(sideways, ahead[2])
            self._bend = self._bend + self.settings.steer_gain * interval * angle * ahead[:2] / sideways
        self._bend = np.clip(self._bend, seen.bend - self._lead, seen.bend + self._lead)
        size = np.linalg.norm(self._bend)
        if size > self._bend_limit:
            self._bend *= self._bend_limit / size

    def _should_back_off(self, seen: Observation) -> bool:
        tip_force = seen.link_forces[-self._tip_links :].max()
        waiting = seen.time - self._local_time
        return bool(
            waiting > 0.5
            and (
                tip_force > self.settings.tip_force_limit
                or seen.link_forces.max() > self.settings.wall_force_limit
                or seen.push_force > self.settings.push_force_limit
                or waiting > self.settings.patience
            )
        )

    def _begin_retreat(self, seen: Observation, arc: float) -> None:
        self.attempts += 1
        distance = self.settings.retreat_distance * min(self.attempts, 4)
        if self.settings.straighten:
            distance = self.settings.straighten_distance
        self._retreat_until = max(0.02, seen.insertion - distance)
        self._retreat_from, self._held_arc = seen.insertion, arc
        # Alternate: a turn one way, twice back, and so on, so that the shaft does not wind up.
        self._roll_goal = self.settings.roll_step * ((self.attempts + 1) // 2) * (-1) ** self.attempts

    def _retreat_over(self, seen: Observation, arc: float, until: float) -> bool:
        self._held_arc = max(self._held_arc, arc)
        if not self.settings.straighten:
            return seen.insertion <= until
        slipped = arc < self._held_arc - self.settings.slip or seen.insertion <= arc
        return seen.insertion <= until or (slipped and seen.insertion <= self._retreat_from - LEAST_RETREAT)

    def _retreat_rate(self, seen: Observation) -> float:
        if not self.settings.straighten:
            return -self.settings.retreat_rate
        spare = 1 - max(
            seen.link_forces.max() / self.settings.wall_force_limit, -seen.push_force / self.settings.push_force_limit
        )
        return -self.settings.retreat_rate * float(np.clip(2 * spare, 0.0, 1.0))

    def _advance_rate(self, seen: Observation, interval: float) -> float:
        spare = 1 - max(
            seen.link_forces[-self._tip_links :].max() / self.settings.tip_force_limit,
            seen.link_forces.max() / self.settings.wall_force_limit,
            seen.push_force / self.settings.push_force_limit,
        )
        rate = self.settings.advance_rate * float(np.clip(2 * spare, 0.15, 1.0))
        # The hand never aims far beyond where the shaft is: the push would only build up.
        return min(rate, (self.settings.hand_lead_limit - seen.hand_lead) / interval)

    def _pulls(self) -> Float[np.ndarray, "4"]:
        up, left = self._bend * self._pull_per_angle
        return np.clip(np.array([up, left, -up, -left]), 0.0, self._wires.pull_limit)
