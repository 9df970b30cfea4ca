"""`haustra trials`: published trials of colonoscopes with known answers, repeated in virtual patients."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from haustra.fields import number, whole

if TYPE_CHECKING:
    from haustra.envs.study.trials import Answer

TABLE = "trials.json"
"""What a folder of trials holds for docs/validation/trials.md, beside its stores."""


@dataclass(frozen=True)
class Trials:
    """Repeat published trials of colonoscopes in virtual patients: is their known answer reproduced?"""

    names: Annotated[tuple[str, ...], tyro.conf.Positional] = ()
    """Names of shipped trials (assets/trials), or files that end in .toml; all that ship when none is given."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("trials")
    """Folder for the patients examined so far; the same command goes on where it was stopped."""
    patients: int = whole(3, 100_000, default=24)
    """Number of patients, each examined by both arms."""
    driver: str = "endoscopist"
    """Who drives: endoscopist, follower, a TOML file of settings, or a policy."""
    seconds: float = number("s", 1.0, 3600.0, default=960.0)
    """Longest insertion [s]; as that of the cohort's four hundred patients."""
    seed: int = whole(0, 2**32 - 1, default=0)
    """Seed of the Latin hypercube that patients are drawn by."""
    backend: str = "linear"
    """What computes: linear, or linear-gpu."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Run the trials and tell their effects."""
        from haustra.envs.study.trials import run_trials, trial_names
        from haustra.files import prepare_folder, write_json
        from haustra.scripts.console import progress_bar

        names = self.names or trial_names()
        prepare_folder(self.output)
        asked = {name: getattr(self, name) for name in ("patients", "driver", "seconds", "seed", "backend")}
        with progress_bar("trials", 1, unit="arms") as advance:
            answers = run_trials(
                names, self.output, **asked, progress=lambda done, total, note: advance(done, note, total)
            )
        write_json(self.output / TABLE, {"asked": asked, "trials": [told(answer) for answer in answers]})
        if not self.json:
            return {answer.name: _line(answer) for answer in answers}
        return {
            "trials": [
                {
                    "name": answer.name,
                    "expected": answer.trial.expected,
                    "effect": answer.effect,
                    "low": answer.low,
                    "high": answer.high,
                    "reproduced": answer.reproduced,
                    "resolved": answer.resolved,
                }
                for answer in answers
            ]
        }


def _line(answer: "Answer") -> str:
    """A trial's answer in a table."""
    if answer.effect is None:
        return "too few patients tell the endpoint"
    unit = "" if answer.trial.endpoint.unit == "1" else f" {answer.trial.endpoint.unit}"
    verdict = "resolved" if answer.resolved else "not resolved"
    return (
        f"{answer.effect:+.3g}{unit} ({answer.low:+.3g} to {answer.high:+.3g}), {answer.patients} pairs; "
        f"published {answer.trial.expected}: {f'reproduced, {verdict}' if answer.reproduced else 'NOT reproduced'}"
    )


def told(answer: "Answer") -> dict[str, Any]:
    """All that is known of a trial's answer, as plain JSON values."""
    from dataclasses import asdict

    return {**asdict(answer), "reproduced": answer.reproduced, "resolved": answer.resolved}
