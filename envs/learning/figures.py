"""Pictures of an evaluation and of a learning curve."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from haustra.envs.learning.evaluate import Evaluation


def draw_evaluations(evaluations: Sequence[Evaluation], path: Path) -> Path:
    """Completion with intervals, how far each episode came, and peak forces, driver by driver."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.2), layout="constrained")
    shares, ways, forces = figure.subplots(1, 3)
    for row, one in enumerate(evaluations):
        found = one.summary()
        for shift, name, mark in ((-0.1, "completion", "o"), (0.1, "safe_completion", "s")):
            low, high = found[f"{name}_bootstrap"] or found[f"{name}_wilson"]
            shares.plot([low, high], [row + shift] * 2, color="grey")
            shares.plot(found[name], row + shift, mark, color="tab:blue", label=name if row == 0 else None)
        way = np.sort([episode.progress for episode in one.episodes])
        ways.plot(way, np.linspace(0, 1, len(way)), label=one.driver)
        force = np.sort([episode.peak_force_N for episode in one.episodes])
        forces.plot(force, np.linspace(0, 1, len(force)), label=one.driver)
    shares.set_yticks(range(len(evaluations)), [one.driver for one in evaluations])
    shares.set(xlim=(-0.02, 1.02), xlabel="share of episodes")
    shares.legend(fontsize="small")
    ways.set(xlabel="share of the way", ylabel="share of episodes below")
    forces.set(xlabel="peak wall force on a link [N]")
    ways.legend(fontsize="small")
    figure.savefig(path, dpi=120)
    return path


def draw_curve(curves: Sequence[Path], path: Path) -> Path:
    """Progress and completion over environment steps, one line a training run."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 3), layout="constrained")
    ways, shares = figure.subplots(1, 2)
    for file in curves:
        with file.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        steps = [float(row["steps"]) for row in rows]
        ways.plot(steps, [float(row["progress"]) for row in rows], label=file.parent.name)
        shares.plot(steps, [float(row["reached"]) for row in rows])
    ways.set(xlabel="environment steps", ylabel="share of the way", ylim=(0, 1))
    shares.set(xlabel="environment steps", ylabel="caecum reached", ylim=(0, 1))
    ways.legend(fontsize="small")
    figure.savefig(path, dpi=120)
    return path
