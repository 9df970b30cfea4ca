"""A policy at the wheel."""

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.learning.recall import Recall
from haustra.envs.tasks.actions import actions_of
from haustra.envs.tasks.observation import Observation


class PolicyDriver:
    """Takes the policy's mean action, or draws actions as the policy did in training."""

    def __init__(self, policy: MlpPolicy, *, sampled: bool = False, seed: int = 0) -> None:
        """Drive by this policy; drawn actions are those of the seed."""
        self._policy = policy
        self._random = np.random.default_rng(seed) if sampled else None
        self._recall = Recall(np, policy.recalls, policy.config.drive.control_interval)
        self._action, self._begins = np.zeros((1, len(actions_of(policy.config)))), np.ones(1, bool)

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """Nothing of before is remembered there."""
        self._begins = self._begins | worlds

    def act(self, seen: Observation) -> Float[np.ndarray, "worlds actions"]:
        """The policy's actions."""
        shown = self._policy.shown(seen)
        begins = np.broadcast_to(self._begins, len(shown)).astype(np.float32)[:, None]
        last = np.broadcast_to(self._action, (len(shown), self._action.shape[1])).astype(np.float32)
        self._action = self._policy.act(self._recall.look(shown, last, begins), self._random)
        self._begins = np.zeros(len(shown), bool)
        return self._action
