"""A policy at the handles of many scopes: it sees what the environments show, and its actions mean the same."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from haustra.envs.learning.drivers import PolicyDriver
from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.runs.insertion_program import TOLD
from haustra.envs.runs.linear_insertions import LinearInsertions
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.state import Readings
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.actions import Asked, Wires, asked, within
from haustra.envs.tasks.calls import whole_steps
from haustra.envs.tasks.senses import Senses
from haustra.errors import UnsupportedSceneError

_BY_RAYS_AND_HAND = {"state", "lumen", "imager", "recent"}
"""Parts of an observation that can be shown where no environment is."""


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


class PolicyHands:
    """Decides for all scopes of a backend at once, from what was read off and looked up."""

    def __init__(self, policy: MlpPolicy, backend: LinearBackend, settings: PolicySettings) -> None:
        """Take the handles of scopes that lie at their starts."""
        self._driver = PolicyDriver(policy, sampled=settings.sampled, seed=settings.seed)
        self._drive = policy.config.drive
        self._wires = Wires(gain=1.0, slack=0.0, limit=backend.scene.design.wires.pull_limit)
        self._length = backend.scene.cable.length
        self._senses = Senses(policy.config, self._drive.control_interval, backend.read())
        self.wheels = np.zeros(backend.worlds), np.zeros(backend.worlds)
        """How far the wheels are turned, towards up and left [1]."""
        self._action: Float[np.ndarray, "worlds 4"] | None = None

    def decide(self, seen: Readings, lumen: Float[np.ndarray, "worlds _"] | None) -> Asked:
        """What is asked of all hands until the next decision.

        Args:
            seen: what is read off now.
            lumen: what rays into the lumen show (`haustra.envs.tasks.observation.lumen`); None where nobody looks.
        """
        if self._action is not None:
            self._senses.acted(seen, self._action, self.wheels)
        shown = self._senses.parts if lumen is None else self._senses.parts | {"lumen": lumen}
        sound, action = within(np, tuple(self._driver.act(shown).T))
        hand = {"lead": seen.hand_lead, "outside": self._length - seen.insertion}
        interval = self._drive.control_interval
        inputs = asked(np, self._drive, interval, action, sound, self.wheels, self._wires, **hand)
        self._action, self.wheels = np.column_stack(action), inputs.wheels
        return inputs


class BatchHands:
    """A policy that drives a batch of insertions by `haustra.envs.control.held.HeldHand`.

    The batch must look for the lumen (`haustra.envs.tasks.ray_program.LumenSight`).
    """

    def __init__(self, batch: LinearInsertions, policy: MlpPolicy, settings: PolicySettings) -> None:
        """Take the handles.

        Raises:
            InvalidOptionError: when the policy's control interval is no whole number of the batch's.
        """
        self._batch, self._hands = batch, PolicyHands(policy, batch.backend, settings)
        self._looks = "lumen" in seen_by.sizes(policy.config)
        self.every = whole_steps(policy.config.drive.control_interval, batch.interval)
        """Control intervals of the batch between two decisions."""

    def __call__(self) -> None:
        """Decide, and tell the hands."""
        backend, lumen = self._batch.backend, None
        if self._looks:
            lumen = np.ascontiguousarray(self._batch.told()[len(TOLD) :].T, np.float32)
        inputs = self._hands.decide(backend.read(), lumen)
        backend.tell_driver(0, np.column_stack([inputs.push_rate, inputs.roll_rate, *inputs.pulls]))


def require_shown(policy: MlpPolicy) -> None:
    """Refuse a policy of another device or task, or one that sees pictures or what no device knows.

    Raises:
        UnsupportedSceneError: naming what cannot be shown.
    """
    if policy.drives is not None:
        raise UnsupportedSceneError(f"The policy drives '{policy.drives.device}': name one for a scope.")
    if policy.config.task != "insertion":
        raise UnsupportedSceneError(f"The policy was trained for '{policy.config.task}': name one for insertion.")
    if unknown := set(seen_by.sizes(policy.config)) - _BY_RAYS_AND_HAND:
        raise UnsupportedSceneError(
            f"The policy sees {', '.join(sorted(unknown))}, which runs do not show: evaluate it instead."
        )
