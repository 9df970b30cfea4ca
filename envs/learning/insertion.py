"""One insertion by a trained policy, in linear time: it sees what the environments show, and nothing else."""

import numpy as np
from jaxtyping import Float

from haustra.envs.learning.hands import PolicyHands, PolicySettings, require_shown
from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.runs.insertion import CONTROL_INTERVAL, Insertion, Progress, drive
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.state import Controls, Readings
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.calls import whole_steps
from haustra.envs.tasks.case import case_of
from haustra.envs.tasks.sight import HostEyes, Sight
from haustra.errors import UnsupportedSceneError
from haustra.models.scene import Scene
from haustra.models.wall.lumen_table import stack


class PolicyHand:
    """A policy at the handle of one scope: decides at an interval of its own, and holds what it asks for until then."""

    attempts = 0
    """It never backs off by rule."""
    gives_up = False
    """Nor gives up by rule."""

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
        design, self._scope = scope.scene.design, scope
        self.interval = policy.config.drive.control_interval
        self._hands = PolicyHands(policy, scope.many, settings)
        self._angle_per_turn = design.wires.pull_limit / design.pull_per_angle
        self._eyes = HostEyes(sight, scope.many) if "lumen" in seen_by.sizes(policy.config) else None
        self._until, self._hand = 0.0, Controls(0.0, 0.0)

    @property
    def asked(self) -> Float[np.ndarray, "2"]:
        """Bend that it steers for, towards wires 'up' and 'left' [rad]."""
        return self._angle_per_turn * np.concatenate(self._hands.wheels)

    def act(self, seen: Readings, arc: float, interval: float) -> Controls:
        """Inputs for the next `interval` [s]; a new decision where the last has been held for the policy's own."""
        if seen.time > self._until - interval / 2:
            self._hand, self._until = self._decide(), seen.time + self.interval
        return self._hand

    def _decide(self) -> Controls:
        seen, lumen = self._scope.many.read(), None
        if self._eyes is not None:
            rays = self._eyes.tip_distances(np.zeros(1, int), seen.tip, seen.tip_frame, seen.tip_arc)
            lumen = seen_by.lumen(rays)
        inputs = self._hands.decide(seen, lumen)
        return Controls(float(inputs.push_rate[0]), float(inputs.roll_rate[0]), np.concatenate(inputs.pulls))


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
    require_shown(policy)
    options = scene.options
    if options.gas is not None:
        raise UnsupportedSceneError("Policies see colons of fixed width: leave gas out, or let another driver drive.")
    case = case_of(scene.colon, device_radius=scene.cable.radius)
    tables = stack([case.with_mesentery(options.abdomen) if options.mesentery else case.tables])
    scope = LinearSingle(scene, tables=tables)
    hand = PolicyHand(policy, settings, scope, Sight([case]))
    every = _longest_share(hand.interval, options.timestep)
    return drive(scope, hand, settings, until=seconds, arc=options.start_depth, every=every, progress=progress)


def _longest_share(interval: float, timestep: float) -> float:
    """Longest time between two records that divides a control interval and is no longer than other drivers' [s]."""
    steps = whole_steps(interval, timestep)
    most = CONTROL_INTERVAL + timestep / 2
    return next(interval / parts for parts in range(1, steps + 1) if steps % parts == 0 and interval / parts < most)
