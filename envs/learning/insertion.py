"""One insertion by a trained policy, in linear time: it sees what the environments show, and nothing else."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.runs.insertion import CONTROL_INTERVAL, Insertion, Progress, drive
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.state import Controls, Readings
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.actions import Wires, asked, within
from haustra.envs.tasks.calls import whole_steps
from haustra.envs.tasks.case import case_of
from haustra.envs.tasks.senses import Senses
from haustra.envs.tasks.sight import HostEyes, Sight
from haustra.errors import UnsupportedSceneError
from haustra.models.scene import Scene
from haustra.models.wall.lumen_table import stack

_BY_RAYS_AND_HAND = {"state", "lumen", "imager", "recent"}
"""Parts of an observation that a single run can show."""


@dataclass(frozen=True)
class PolicySettings:
    """Which policy drives, and how its actions are taken."""

    policy: str
    """Name or folder of the policy."""
    weights: str
    """Hash of its weights."""
    advance_rate: float
    """Fastest push that it asks for [m/s]."""
    sampled: bool = True
    """Whether actions are drawn as in training; means otherwise."""
    seed: int = 0
    """Seed of those draws."""


class PolicyHand:
    """A policy at the handle of one scope: decides at an interval of its own, and holds what it asks for until then."""

    attempts = 0
    """It never backs off by rule."""

    def __init__(self, policy: MlpPolicy, settings: PolicySettings, scope: LinearSingle, sight: Sight) -> None:
        """Take the handle.

        Args:
            policy: decides.
            settings: how its actions are taken.
            scope: what it drives.
            sight: rays into the scope's colon.

        Raises:
            InvalidOptionError: when the policy does not know how far its actions vary.
        """
        design, config = scope.scene.design, policy.config
        self._policy, self._scope, self._drive = policy, scope, config.drive
        self._random = np.random.default_rng(settings.seed) if settings.sampled else None
        self.interval = config.drive.control_interval
        self._wires = Wires(gain=1.0, slack=0.0, limit=design.wires.pull_limit)
        self._angle_per_turn = design.wires.pull_limit / design.pull_per_angle
        self._eyes = HostEyes(sight, scope.many) if "lumen" in seen_by.sizes(config) else None
        self._senses = Senses(config, self.interval, scope.many.read())
        self._wheels, self._action = (np.zeros(1), np.zeros(1)), None
        self._until, self._hand = 0.0, Controls(0.0, 0.0)

    @property
    def asked(self) -> Float[np.ndarray, "2"]:
        """Bend that it steers for, towards wires 'up' and 'left' [rad]."""
        return self._angle_per_turn * np.concatenate(self._wheels)

    def act(self, seen: Readings, arc: float, interval: float) -> Controls:
        """Inputs for the next `interval` [s]; a new decision where the last has been held for the policy's own."""
        if seen.time > self._until - interval / 2:
            self._hand, self._until = self._decide(), seen.time + self.interval
        return self._hand

    def _decide(self) -> Controls:
        seen = self._scope.many.read()
        if self._action is not None:
            self._senses.acted(seen, self._action, self._wheels)
        shown = self._senses.parts
        if self._eyes is not None:
            rays = self._eyes.tip_distances(np.zeros(1, int), seen.tip, seen.tip_frame, seen.tip_arc)
            shown["lumen"] = seen_by.lumen(rays)
        sound, action = within(np, tuple(self._policy.act(shown, self._random).T))
        outside = self._scope.scene.cable.length - seen.insertion
        hand = {"lead": seen.hand_lead, "outside": outside}
        inputs = asked(np, self._drive, self.interval, action, sound, self._wheels, self._wires, **hand)
        self._action, self._wheels = np.column_stack(action), inputs.wheels
        pulls = np.concatenate(inputs.pulls)
        return Controls(float(inputs.push_rate[0]), float(inputs.roll_rate[0]), pulls)


def run_policy(
    scene: Scene,
    policy: MlpPolicy,
    settings: PolicySettings,
    *,
    seconds: float,
    progress: Progress | None = None,
) -> Insertion:
    """Let a policy drive a scope for up to `seconds` of simulated time.

    Args:
        scene: colon and scope, of wall law 'table'.
        policy: drives.
        settings: which it is, for the record, and how its actions are taken.
        seconds: simulated time [s].
        progress: told now and then how far it is.

    Raises:
        InvalidOptionError: when the policy's control interval is no whole number of time steps.
        UnsupportedSceneError: when the backend 'linear' cannot honour the scene, or the policy sees what single runs do
            not show.
    """
    _require_shown(policy)
    options = scene.options
    if options.gas is not None:
        raise UnsupportedSceneError("Policies see colons of fixed width: leave gas out, or let another driver drive.")
    case = case_of(scene.colon, device_radius=scene.cable.radius)
    tables = stack([case.hung(options.abdomen) if options.mesentery else case.tables])
    scope = LinearSingle(scene, tables=tables)
    hand = PolicyHand(policy, settings, scope, Sight([case]))
    every = _longest_share(hand.interval, options.timestep)
    return drive(scope, hand, settings, until=seconds, arc=options.start_depth, every=every, progress=progress)


def _require_shown(policy: MlpPolicy) -> None:
    """Refuse a policy of another task, or one that sees pictures or what no device knows."""
    if policy.config.task != "insertion":
        raise UnsupportedSceneError(f"The policy was trained for '{policy.config.task}': name one for insertion.")
    if unknown := set(seen_by.sizes(policy.config)) - _BY_RAYS_AND_HAND:
        raise UnsupportedSceneError(
            f"The policy sees {', '.join(sorted(unknown))}, which single runs do not show: evaluate it instead."
        )


def _longest_share(interval: float, timestep: float) -> float:
    """Longest time between two records that divides a control interval and is no longer than other drivers' [s]."""
    steps = whole_steps(interval, timestep)
    most = CONTROL_INTERVAL + timestep / 2
    return next(interval / parts for parts in range(1, steps + 1) if steps % parts == 0 and interval / parts < most)
