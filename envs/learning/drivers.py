"""A policy at the wheel."""

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.tasks.observation import Observation


class PolicyDriver:
    """Takes the policy's mean action."""

    def __init__(self, policy: MlpPolicy) -> None:
        """Drive by this policy."""
        self._policy = policy

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """Nothing is remembered."""

    def act(self, seen: Observation) -> Float[np.ndarray, "worlds 4"]:
        """The policy's actions."""
        return self._policy.act(seen)
