"""What a learner is paid for: one small function a term, weighted by `haustra.envs.tasks.config.Weights`.

Each takes the moments before and after an action, all worlds at once, and the limits. Costs are negative.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.tasks.config import Limits, Weights


@dataclass(frozen=True)
class Moment:
    """What rewards are computed from; one value a world."""

    progress: Float[np.ndarray, " worlds"]
    """Share of the way that the tip has come, the furthest so far [1]."""
    place: Float[np.ndarray, " worlds"]
    """Share of the way at which the tip is now [1]."""
    facing: Float[np.ndarray, " worlds"]
    """Cosine between the viewing direction and the way: 1 ahead, -1 back; 1 when nothing is paid for it [1]."""
    wall_force: Float[np.ndarray, " worlds"]
    """Largest resultant on one link at the end of the last action [N]; a peak between two actions is not seen."""
    excess: Float[np.ndarray, " worlds"]
    """Scope inside beyond the colon passed [m]."""
    coverage: Float[np.ndarray, " worlds"]
    """Share of the surface seen so far [1]."""
    reached: Bool[np.ndarray, " worlds"]
    """The end of the way is reached."""
    perforated: Bool[np.ndarray, " worlds"]
    """A wall force exceeded the perforation limit."""


Term = Callable[[Moment, Moment, Limits], Float[np.ndarray, " worlds"]]


def progress(before: Moment, after: Moment, limits: Limits) -> Float[np.ndarray, " worlds"]:
    """Share of the way gained beyond the furthest place so far; going back and forth earns nothing."""
    return after.progress - before.progress


def advance(before: Moment, after: Moment, limits: Limits) -> Float[np.ndarray, " worlds"]:
    """Share of the way gained, or lost when the tip slips back: unlike `progress` it says so at once."""
    return after.place - before.place


def facing(before: Moment, after: Moment, limits: Limits) -> Float[np.ndarray, " worlds"]:
    """Nought while the tip looks along the way, minus one when it looks back, as one that is bent over does."""
    return (after.facing - 1.0) / 2.0


def reached(before: Moment, after: Moment, limits: Limits) -> Float[np.ndarray, " worlds"]:
    """One, at the end of the way."""
    return after.reached.astype(float)


def time(before: Moment, after: Moment, limits: Limits) -> Float[np.ndarray, " worlds"]:
    """Minus one, always."""
    return -np.ones_like(after.progress)


def wall_force(before: Moment, after: Moment, limits: Limits) -> Float[np.ndarray, " worlds"]:
    """Minus the square of the largest wall force over the safe one."""
    return -((after.wall_force / limits.safe_force) ** 2)


def looping(before: Moment, after: Moment, limits: Limits) -> Float[np.ndarray, " worlds"]:
    """Minus the length of scope inside beyond the colon passed."""
    return -np.maximum(after.excess, 0.0)


def perforation(before: Moment, after: Moment, limits: Limits) -> Float[np.ndarray, " worlds"]:
    """Minus one, when the wall breaks."""
    return -after.perforated.astype(float)


def coverage(before: Moment, after: Moment, limits: Limits) -> Float[np.ndarray, " worlds"]:
    """Share of the surface newly seen."""
    return after.coverage - before.coverage


TERMS: Mapping[str, Term] = {
    "progress": progress,
    "advance": advance,
    "facing": facing,
    "reached": reached,
    "time": time,
    "wall_force": wall_force,
    "looping": looping,
    "perforation": perforation,
    "coverage": coverage,
}
"""Terms by the name of their weight."""


def reward(before: Moment, after: Moment, weights: Weights, limits: Limits) -> dict[str, Float[np.ndarray, " worlds"]]:
    """Every term with a weight, weighted; their sum is the reward."""
    return {
        name: weight * TERMS[name](before, after, limits) for name, weight in asdict(weights).items() if weight != 0
    }
