"""What trainings of either learner do alike: rates and limits that change, the curve, where a policy is from."""

from pathlib import Path
from typing import Any

from haustra.envs.learning.curve import DEVICE_EPISODE, EPISODE, WITHDRAWAL_EPISODE, Curve
from haustra.envs.learning.settings import Training
from haustra.provenance import Provenance, backend_record

LEAST_DEVIATION = 0.1
"""An observation is divided by no less: entries are scaled to about one, and some hardly ever change."""
SAVE_EVERY = 120.0
"""Within a leg, on other backends than 'native', what is lost to an interruption at most [s]; an engineering choice."""
_LEAST_RATE = 0.1
"""Learning rate at the end of annealing, as a share of the first."""


def learning_rate(training: Training, steps: int) -> float:
    """After that many steps of the whole run."""
    share = min(1.0, steps / training.steps) if training.anneal else 0.0
    return training.learning_rate * (1 - (1 - _LEAST_RATE) * share)


def perforation_force(training: Training, steps: int) -> float:
    """The limit after that many steps of the whole run [N]."""
    last = training.task.limits.perforation_force
    if training.ease is None:
        return last
    first, share = training.ease
    return last + (first - last) * max(0.0, 1 - steps / (share * training.steps))


def curve_of(training: Training, folder: Path, *, steps: int) -> Curve:
    """The curve of a training that goes on after so many steps.

    Thousands of worlds end episodes at every step, so rows are of a few seconds each.
    """
    withdraws = training.task.task == "withdrawal"
    episode = DEVICE_EPISODE if training.drives else WITHDRAWAL_EPISODE if withdraws else EPISODE
    return Curve(folder / "curve.csv", steps=steps, episodes_a_row=max(16, training.worlds // 4), episode=episode)


def made_by(training: Training, steps: int) -> dict[str, Any]:
    """What a policy says of its training after that many steps."""
    provenance = Provenance({}, {}, backend=backend_record(training.backend)).to_json()
    return {"training": training.to_json(), "steps": steps, "provenance": provenance}
