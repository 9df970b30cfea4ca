"""Pictures of an evaluation and of a learning curve."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.learning.curve import SeedCurves
from haustra.envs.learning.evaluate import Evaluation
from haustra.envs.learning.evaluate_device import DeviceEvaluation
from haustra.files import prepare_folder, write_atomically

_LONGEST = 32
"""Characters of a label at most."""


def draw_evaluations(evaluations: Sequence[Evaluation], path: Path) -> Path:
    """Completion with intervals, how far each episode came, and peak forces, driver by driver."""
    drawn = []
    for one in evaluations:
        found, names = one.summary(), ("completion", "safe_completion")
        shares = {name: (found[name], found[f"{name}_bootstrap"] or found[f"{name}_wilson"]) for name in names}
        drawn.append((one, shares))
    return _draw(drawn, "peak wall force on a link [N]", path)


def draw_device_evaluations(evaluations: Sequence[DeviceEvaluation], path: Path) -> Path:
    """Way and share that arrived with intervals, and peak forces, driver by driver of a device that is no scope."""
    drawn = []
    for one in evaluations:
        found, names = one.summary(), ("reached", "progress")
        shares = {name: (found[name], found.get(f"{name}_bootstrap", [found[name]] * 2)) for name in names}
        drawn.append((one, shares))
    return _draw(drawn, "peak wall force on a body [N]", path)


def _draw(drawn: Sequence[tuple[Any, dict[str, tuple[float, Sequence[float]]]]], force_label: str, path: Path) -> Path:
    """Evaluations, each with its shares and their intervals, by name."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.2), layout="constrained")
    panel, ways, forces = figure.subplots(1, 3)
    for row, (one, shares) in enumerate(drawn):
        for shift, mark, (name, (share, interval)) in zip((-0.1, 0.1), "os", shares.items(), strict=True):
            panel.plot(interval, [row + shift] * 2, color="grey")
            panel.plot(share, row + shift, mark, color="tab:blue", label=name if row == 0 else None)
        way = np.sort([episode.progress for episode in one.episodes])
        ways.plot(way, np.linspace(0, 1, len(way)), label=_label(one.driver))
        force = np.sort([episode.peak_force_N for episode in one.episodes])
        forces.plot(force, np.linspace(0, 1, len(force)), label=_label(one.driver))
    panel.set_yticks(range(len(drawn)), [_label(one.driver) for one, _ in drawn])
    panel.set(xlim=(-0.02, 1.02), xlabel="share of episodes")
    panel.legend(fontsize="small")
    ways.set(xlabel="share of the way", ylabel="share of episodes below")
    forces.set(xlabel=force_label)
    ways.legend(fontsize="small")
    return write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=120))


def _label(driver: str) -> str:
    """A driver's name; of a long one, such as a folder's path, its end, since axes have to fit beside it."""
    return driver if len(driver) <= _LONGEST else f"…{driver[1 - _LONGEST :]}"


def draw_curves(curves: SeedCurves, names: Sequence[str], path: Path) -> Path:
    """Way, completion and perforation over environment steps: each run, their mean, and their range.

    Raises:
        OutputError: when the file cannot be written.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.2), layout="constrained")
    panels = figure.subplots(1, 3)
    labels = {"progress": "share of the way", "reached": "caecum reached", "perforated": "perforated"}
    for panel, (column, label) in zip(panels, labels.items(), strict=True):
        runs = curves.columns[column]
        for run, name in zip(runs, names, strict=True):
            panel.plot(curves.steps, run, linewidth=0.8, alpha=0.6, label=name)
        panel.plot(curves.steps, runs.mean(axis=0), color="black", linewidth=1.8, label="mean")
        panel.fill_between(curves.steps, runs.min(axis=0), runs.max(axis=0), color="grey", alpha=0.25, linewidth=0)
        panel.set(xlabel="environment steps", ylabel=label, ylim=(-0.02, 1.02))
        panel.ticklabel_format(axis="x", style="sci", scilimits=(0, 4))
    panels[0].legend(fontsize="small")
    prepare_folder(path.parent)
    return write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=120))
