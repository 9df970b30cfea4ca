"""What a learner is paid for: one small function a term, weighted by `haustra.envs.tasks.config.Weights`.

Each takes numpy or what writes programs, what was kept before an action, the moment after it, and the limits. Costs are
negative.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

from haustra.envs.tasks.config import Limits, Weights
from haustra.envs.tasks.moment import Kept, Moment

Term = Callable[[Any, Kept, Moment, Limits], Any]


def progress(xp: Any, before: Kept, after: Moment, limits: Limits) -> Any:
    """Share of the way gained beyond the furthest place so far; going back and forth earns nothing."""
    return after.progress - before.progress


def advance(xp: Any, before: Kept, after: Moment, limits: Limits) -> Any:
    """Share of the way gained, or lost when the tip slips back: unlike `progress` it says so at once."""
    return after.place - before.place


def facing(xp: Any, before: Kept, after: Moment, limits: Limits) -> Any:
    """Nought while the tip looks along the way, minus one when it looks back, as one that is bent over does."""
    return (after.facing - 1.0) / 2.0


def reached(xp: Any, before: Kept, after: Moment, limits: Limits) -> Any:
    """One, at the end of the way."""
    return xp.where(after.reached, 1.0, 0.0)


def time(xp: Any, before: Kept, after: Moment, limits: Limits) -> Any:
    """Minus one, always."""
    return -1.0 + 0.0 * after.progress


def wall_force(xp: Any, before: Kept, after: Moment, limits: Limits) -> Any:
    """Minus the square of the largest wall force over the safe one."""
    return -((after.wall_force / limits.safe_force) ** 2)


def looping(xp: Any, before: Kept, after: Moment, limits: Limits) -> Any:
    """Minus the length of scope inside beyond the colon passed."""
    return -xp.maximum(after.excess, 0.0)


def perforation(xp: Any, before: Kept, after: Moment, limits: Limits) -> Any:
    """Minus one, when the wall breaks."""
    return xp.where(after.perforated, -1.0, 0.0)


def coverage(xp: Any, before: Kept, after: Moment, limits: Limits) -> Any:
    """Share of the surface newly seen."""
    return after.coverage - before.coverage


def haste(xp: Any, before: Kept, after: Moment, limits: Limits) -> Any:
    """Minus the share of the way that the tip has come sooner than the pace allows."""
    return -after.haste


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
    "haste": haste,
}
"""Terms by the name of their weight."""


def reward(xp: Any, before: Kept, after: Moment, weights: Weights, limits: Limits) -> dict[str, Any]:
    """Every term with a weight, weighted; their sum is the reward."""
    return {
        name: weight * TERMS[name](xp, before, after, limits) for name, weight in asdict(weights).items() if weight != 0
    }
