"""An episode's rules: what a control step led to, as numbers by their names; numpy and programs call the same."""

import math
from dataclasses import dataclass
from typing import Any

from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.coverage import LOOK_EVERY
from haustra.envs.tasks.moment import Dealt, Kept, Sensed, moment, over
from haustra.envs.tasks.rewards import reward

_PLACE = ("tip_arc", "progress", "wall_force", "excess", "coverage")


@dataclass(frozen=True)
class EpisodeRules:
    """A configuration, and how long a control step is."""

    config: TaskConfig
    interval: float
    """Between two actions [s]."""

    @property
    def longest(self) -> int:
        """Control steps after which an episode's time is up."""
        return math.ceil((self.config.limits.seconds - 1e-9) / self.interval)

    @property
    def covers(self) -> bool:
        """Whether what is seen of the mucosa counts."""
        return self.config.task == "withdrawal" or self.config.weights.coverage != 0

    @property
    def look_every(self) -> int:
        """Control steps from one look for mucosa to the next."""
        return max(1, round(LOOK_EVERY / self.interval))

    @property
    def terms(self) -> tuple[str, ...]:
        """Terms of the reward that have a weight, as `concluded` names them."""
        return tuple(f"reward_{name}" for name, weight in vars(self.config.weights).items() if weight != 0)

    @property
    def paid(self) -> tuple[str, ...]:
        """What a world that begins anew is not told: it was not paid, and nothing has ended."""
        return ("terminated", "truncated", "diverged", "reward", *self.terms)

    @property
    def told(self) -> tuple[str, ...]:
        """Names of all that `concluded` tells."""
        return (*self.paid, "age", *_PLACE, "reached", "perforated", "in_caecum", "load", "load_arc", "pain")


def concluded(
    xp: Any, rules: EpisodeRules, dealt: Dealt, kept: Kept, sensed: Sensed, healthy: Any
) -> tuple[Kept, dict[str, Any]]:
    """What is kept of an episode after a control step, and what is told of it, by name.

    Args:
        xp: numpy, or what writes programs.
        rules: of the episode.
        dealt: what it was dealt.
        kept: what was kept of it before, its age apart, which counts this step.
        sensed: what is read off now.
        healthy: whether the world has not diverged.
    """
    config = rules.config
    now, later = moment(xp, config, dealt, kept, sensed, healthy)
    terms = reward(xp, kept, now, config.weights, config.limits)
    ended, late = over(now, kept.age, rules.longest, healthy)
    return later, {
        "terminated": ended,
        "truncated": late,
        "diverged": ~healthy,
        "reward": xp.where(healthy, sum(terms.values()), 0.0),
        **{f"reward_{name}": term for name, term in terms.items()},
        "age": kept.age,
        "tip_arc": sensed.arc,
        "progress": now.progress,
        "wall_force": now.wall_force,
        "excess": now.excess,
        "coverage": now.coverage,
        "reached": now.reached,
        "perforated": now.perforated,
        "in_caecum": later.in_caecum,
        "load": later.load,
        "load_arc": later.load_arc,
        "pain": later.pain,
    }
