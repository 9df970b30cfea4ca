"""`haustra credibility`: what a model may be believed for, as FDA's guidance and ASME V&V 40 ask."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro


@dataclass(frozen=True)
class Credibility:
    """Write the two documents of a credibility assessment: details of the model, and the evidence for a use of it."""

    context: Annotated[Path, tyro.conf.Positional]
    """TOML file with the question of interest, the context of use, the evidence and what is compared."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for both documents, and for the runs that the uncertainty is split by."""
    run: bool = True
    """Run what the file compares, as far as the folder does not hold it yet; its uncertainty is 'none' otherwise."""
    backend: str = "linear"
    """What computes: linear, or linear-gpu."""
    json: bool = False
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Look up the evidence, run the comparison and write the documents."""
        from haustra.envs.study.credibility import CATEGORIES, load_context, look_up
        from haustra.envs.study.uncertainty import run_comparison
        from haustra.envs.view.report.credibility_report import Assessment, write_documents
        from haustra.files import prepare_folder
        from haustra.scripts.console import progress_bar

        context = load_context(self.context)
        for index, one in enumerate(context.evidence):
            _require_verb(f"{self.context.name}: evidence[{index}].command", one.command)
        found = [look_up(one, self.context.parent) for one in context.evidence]
        prepare_folder(self.output)
        uncertainty = None
        if self.run and context.comparison is not None:
            with progress_bar("comparison", 1, unit="jobs") as advance:
                uncertainty = run_comparison(
                    context.comparison,
                    self.output,
                    backend=self.backend,
                    resume=True,
                    progress=lambda done, total, note: advance(done, note, total),
                )
        assessment = Assessment(context, self.context.resolve(), found, uncertainty)
        return {
            "risk": context.risk,
            "evidence": [
                {
                    "category": one.evidence.category,
                    "name": CATEGORIES[one.evidence.category - 1],
                    "claim": one.evidence.claim,
                    "figure": one.figure,
                    "bound": one.evidence.bound,
                    "relation": one.evidence.relation,
                    "within": one.met,
                    "hash": one.hash,
                    "date": one.date,
                }
                for one in found
            ],
            "missing": [CATEGORIES[category - 1] for category in assessment.missing],
            "not_covered": [one.range.name for one in assessment.uncovered],
            "uncertainty": uncertainty and _plain(uncertainty),
            "adequate": assessment.adequate,
            "documents": [str(path) for path in write_documents(self.output, assessment)],
        }


def _plain(uncertainty: Any) -> dict[str, Any]:
    from dataclasses import asdict

    return {**asdict(uncertainty), "driver": uncertainty.driver, "resolved": uncertainty.resolved}


def _require_verb(where: str, command: str) -> None:
    """Refuse a command that this project does not have.

    Raises:
        InvalidStudyError: when it does not begin with haustra and a verb.
    """
    from haustra.errors import InvalidStudyError
    from haustra.scripts.main import verb_of

    try:
        words = shlex.split(command)
    except ValueError:
        words = []
    if words[:1] != ["haustra"] or verb_of(words[1:]) is None:
        raise InvalidStudyError(f"{where}: '{command}' is no command of haustra: begin with 'haustra' and a verb.")
