"""A policy at the wheel."""

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.learning.recall import Recall
from haustra.envs.tasks.observation import LUMEN_SIZE, Observation, flat, sizes
from haustra.errors import InvalidOptionError

_NOWHERE = np.append(np.full(LUMEN_SIZE - 2, 0.5, np.float32), np.zeros(2, np.float32))
"""The lumen of who does not see: half the range along each ray, and deep in no direction [1]."""


class PolicyDriver:
    """Takes the policy's mean action, or draws actions as the policy did in training."""

    def __init__(self, policy: MlpPolicy, *, sampled: bool = False, blind: bool = False, seed: int = 0) -> None:
        """Drive by this policy; drawn actions are those of the seed, and where `blind` the lumen is nowhere.

        Raises:
            InvalidOptionError: when a policy that does not look for the lumen is to be blind.
        """
        self._policy, self._blind = policy, blind
        if blind and policy.eyes is None and "lumen" not in sizes(policy.config):
            raise InvalidOptionError("The policy does not look for the lumen: leave `blind` out.")
        self._random = np.random.default_rng(seed) if sampled else None
        self._recall = Recall(np, policy.recalls, policy.interval)
        self._action, self._begins = np.zeros((1, policy.widths[1])), np.ones(1, bool)

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """Nothing of before is remembered there."""
        self._begins = self._begins | worlds

    def act(self, seen: Observation) -> Float[np.ndarray, "worlds actions"]:
        """The policy's actions."""
        shown = flat(_unseen(seen)) if self._blind else self._policy.shown(seen)
        begins = np.broadcast_to(self._begins, len(shown)).astype(np.float32)[:, None]
        last = np.broadcast_to(self._action, (len(shown), self._action.shape[1])).astype(np.float32)
        self._action = self._policy.act(self._recall.look(shown, last, begins), self._random)
        self._begins = np.zeros(len(shown), bool)
        return self._action

    def did(self, action: Float[np.ndarray, "worlds actions"]) -> None:
        """Remember what was done instead of what was proposed, where a person corrects."""
        self._action = action


def _unseen(seen: Observation) -> Observation:
    """What is left of an observation when the lumen is nowhere: by rays or by pictures."""
    felt = {name: part for name, part in seen.items() if name not in ("lumen", "pixels")}
    return felt | {"lumen": np.tile(_NOWHERE, (len(next(iter(seen.values()))), 1))}
