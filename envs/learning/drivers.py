"""A policy at the wheel."""

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.tasks.observation import Observation


class PolicyDriver:
    """Takes the policy's mean action, or draws actions as the policy did in training."""

    def __init__(self, policy: MlpPolicy, *, sampled: bool = False, seed: int = 0) -> None:
        """Drive by this policy; drawn actions are those of the seed."""
        self._policy = policy
        self._random = np.random.default_rng(seed) if sampled else None

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """Nothing is remembered."""

    def act(self, seen: Observation) -> Float[np.ndarray, "worlds actions"]:
        """The policy's actions."""
        return self._policy.act(seen, self._random)
