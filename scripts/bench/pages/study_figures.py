"""Figures of docs/studies from a sweep's folder.

`python -m haustra.scripts.bench.pages.study_figures DIR -o docs/images`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class StudyFigures:
    """Draw the Pareto front and the main effects of a sweep as PNG files."""

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of a sweep."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the pictures."""
    name: str | None = None
    """Name of the pictures, after 'study-'; the study's question when not given."""

    def __call__(self) -> list[Path]:
        """Draw both."""
        from haustra.envs.study.export import results_frame
        from haustra.envs.study.ranking import design_table, effects_of, ranked
        from haustra.envs.study.store import read_store

        with read_store(self.folder) as store:
            study, frame = store.study, results_frame(store)
        scores = [objective.score for objective in study.objectives]
        table = design_table(frame, study, scores)
        found = ranked(table)
        conditions = [name for name in ("friction", "speed_m_s") if name in frame.columns]
        effects = effects_of(frame, study, conditions)
        stem = self.output / f"study-{self.name or study.question}"
        return [_front(stem, table, found.places, found.front, scores), _effects(stem, effects)]


def _front(stem: Path, table, places, front, scores) -> Path:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * (len(scores) - 1), 3.6), layout="constrained")
    panels = figure.subplots(1, len(scores) - 1, squeeze=False)[0]
    for panel, other in zip(panels, scores[1:], strict=True):
        x, y = table.means(scores[0])[places], table.means(other)[places]
        panel.scatter(x[~front], y[~front], s=9, color="#9aa7b5", label="other designs")
        panel.scatter(x[front], y[front], s=16, color="#c2413b", label="Pareto front of all objectives")
        panel.set(xlabel=scores[0].replace("_", " "), ylabel=other.replace("_", " "))
    panels[0].legend(fontsize=7)
    return _save(figure, stem.with_name(f"{stem.name}-front.png"))


def _effects(stem: Path, effects) -> Path:
    from matplotlib.figure import Figure

    columns = len(next(iter(effects.values())))
    figure = Figure(figsize=(2.3 * columns, 1.9 * len(effects)), layout="constrained")
    grid = figure.subplots(len(effects), columns, squeeze=False, sharex="col", sharey="row")
    for number, (row, (score, found)) in enumerate(zip(grid, effects.items(), strict=True), start=1):
        for panel, effect in zip(row, found, strict=True):
            means = [each.mean for each in effect.means]
            low = [each.mean - (each.mean if each.low is None else each.low) for each in effect.means]
            high = [(each.mean if each.high is None else each.high) - each.mean for each in effect.means]
            panel.errorbar(effect.levels, means, [low, high], color="#c2413b", marker="o", markersize=3, linewidth=1)
            panel.tick_params(labelsize=7)
            if number == len(effects):
                panel.set_xlabel(effect.factor.replace("_", " "), fontsize=8)
        row[0].set_ylabel(score.replace("_", " "), fontsize=8)
    return _save(figure, stem.with_name(f"{stem.name}-effects.png"))


def _save(figure, path: Path) -> Path:
    from haustra.files import prepare_folder, write_atomically

    prepare_folder(path.parent)
    return write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=130))


if __name__ == "__main__":
    tyro.cli(StudyFigures)()
