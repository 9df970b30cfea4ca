"""`haustra train curves`: what several seeds of a training came to."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro


@dataclass(frozen=True)
class TrainCurves:
    """Draw the learning curves of runs of one training with different seeds: each run, their mean and their range."""

    runs: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Folders that `haustra train` wrote, one for each seed."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """PNG file to draw the curves in."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Draw, and say where the runs stand at the last step that all of them have done."""
        from haustra.envs.learning.curve import read_curve, seed_curves
        from haustra.envs.learning.figures import draw_curves

        seeds = _seeds(self.runs)
        found = seed_curves([read_curve(run / "curve.csv") for run in self.runs])
        draw_curves(found, [f"seed {seed}" for seed in seeds], self.output)
        last = {name: found.columns[name][:, -1] for name in ("progress", "reached", "perforated", "return")}
        return {
            "seeds": seeds,
            "steps": int(found.steps[-1]),
            **{
                name: {"mean": float(values.mean()), "range": [float(values.min()), float(values.max())]}
                for name, values in last.items()
            },
            "figure": str(self.output),
        }


def _seeds(runs: tuple[Path, ...]) -> list[int]:
    """Seeds of runs of one training; a mean over different trainings, or over one run twice, would say nothing."""
    import json

    from haustra.errors import InvalidOptionError, UnreadableFileError

    seeds: list[int] = []
    first: dict[str, Any] = {}
    for run in runs:
        try:
            training = json.loads((run / "training.json").read_text(encoding="utf-8"))
            seeds.append(int(training.pop("seed")))
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise UnreadableFileError(f"'{run}' holds no training ({error}): name a folder of it.") from error
        training.pop("steps", None)
        first = first or training
        if different := sorted(name for name in first.keys() | training if first.get(name) != training.get(name)):
            raise InvalidOptionError(
                f"The trainings in '{runs[0]}' and '{run}' differ in {different[0]}: give runs that differ by seed."
            )
    if len(set(seeds)) < len(seeds):
        raise InvalidOptionError(f"Two runs have the same seed ({', '.join(map(str, seeds))}): leave one out.")
    return seeds
