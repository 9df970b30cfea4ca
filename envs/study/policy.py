"""How far a scope gets under a driver that suits it, as a question for studies: each design gets a short training.

One rule, or one policy, suits some designs better than others. Here each design's driver begins as the same policy and
is trained with that design, by the same numbers; what it then does in colons that nobody trained in is the answer.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from haustra.envs.learning.policy import MlpPolicy, load_policy, policy_folder
from haustra.envs.learning.settings import Training, shipped
from haustra.envs.study.questions import Question
from haustra.envs.study.scope import changed_design
from haustra.envs.study.study import Column, Study, Value
from haustra.errors import InvalidOptionError
from haustra.fields import whole
from haustra.models.devices.scope.design import ScopeDesign

MEASURED = {
    "completion": ("1", "share of episodes whose tip came to the caecum's end"),
    "intubation": ("1", "share of episodes whose tip came past the valve"),
    "progress": ("1", "how far the tip came, as a share of the way"),
    "p_perforation": ("1", "share of people whose colon would be perforated"),
    "pain": ("1", "largest tension of wall or mesentery over that which is assumed to hurt"),
    "peak_force_N": ("N", "largest resultant wall force on one link"),
    "mean_force_N": ("N", "its mean"),
}
"""Means over held-out episodes (`haustra.envs.learning.evaluate`): unit, meaning."""
SCORES = (
    *(Column(name, *about) for name, about in MEASURED.items()),
    *(
        Column(f"{name}_before", unit, f"{said}, under the policy to begin as")
        for name, (unit, said) in MEASURED.items()
    ),
    Column("training_steps", "1", "environment steps that the training made"),
)


@dataclass(frozen=True)
class PolicyStudyOptions:
    """How drivers are trained and judged."""

    training: str = "for-a-design"
    """A shipped training of the learner 'device': everything that is not named here."""
    start: str = "insertion"
    """Policy that every training begins as: a shipped one's name, or a folder."""
    steps: int = whole(0, 10**10, default=1_000_000)
    """Length of a training in environment steps; 0 judges the policy to begin as."""
    worlds: int = whole(1, 1_000_000, default=256)
    """Number of scopes that a training steps at once."""
    colons: int = whole(1, 100_000, default=24)
    """Number of grown colons to train in, from seed 0 on."""
    held_out: int = whole(1, 100_000, default=20)
    """Number of grown colons to judge in, which no training draws."""
    episodes: int = whole(1, 10_000, default=1)
    """Number of episodes in each of these."""


class Plan(NamedTuple):
    """What one job does."""

    design: ScopeDesign
    start: MlpPolicy
    """Policy to begin as."""
    training: Training
    """What follows, but for where it runs."""
    options: PolicyStudyOptions


def plan(study: Study, variables: Mapping[str, float], conditions: Mapping[str, Value]) -> Plan:
    """What to do for values of the variables and conditions. The task is the policy's own.

    Raises:
        InvalidDesignError: when the design is impossible.
        InvalidOptionError: when the training is not known, or not one of the learner 'device'.
        InvalidStudyError: when a path is not known.
        UnreadableFileError: when there is no such policy.
    """
    own = PolicyStudyOptions(**dict(study.options))  # pyright: ignore[reportArgumentType]
    training, start = shipped(own.training), load_policy(policy_folder(own.start))
    if training.learner != "device":
        raise InvalidOptionError(f"Training '{own.training}' is not of the learner 'device': name one that is.")
    layers, steps = tuple(len(bias) for bias in start.biases[:-1]), max(own.steps, 1)
    task = replace(start.config, seeds=(0, own.colons))
    known = {"layers": layers, "start": own.start, "task": task, "seed": int(conditions["seed"])}
    training = replace(training, worlds=own.worlds, steps=steps, leg=steps, **known)  # pyright: ignore[reportArgumentType]
    return Plan(changed_design(study, variables), start, training, own)


QUESTION = Question(
    scores=SCORES,
    conditions={"seed": Column("seed", "1", "seed of the training's random draws")},
    options=PolicyStudyOptions,
    check=plan,
)
