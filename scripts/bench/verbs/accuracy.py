"""`haustra bench accuracy`: run time against error, question by question."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro


@dataclass(frozen=True)
class BenchAccuracy:
    """Turn every knob of the simulator and measure what it costs and how far the answer is off."""

    questions: str = "all"
    """Names of questions, separated by commas: elastica, motion, release, wires, press, capstan, buckling, propulsion,
    insertion, field, plain, nodes, growth."""
    quick: bool = False
    """Take a few minutes instead of an hour, with coarser references and fewer settings."""
    colons: str = ""
    """Folders of further colons for insertions, separated by commas."""
    rods: Path | None = None
    """Folder of measured rods, whose tip releases are compared."""
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder for accuracy.json; finished questions are kept there, and the next call goes on after them."""
    json: bool = field(default=False)
    """Print one JSON document instead of a table."""

    def __call__(self) -> dict[str, Any]:
        """Ask the questions."""
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read by numpy's BLAS when it is first imported

        from haustra.files import prepare_folder, write_json
        from haustra.scripts.bench.accuracy.question import Effort
        from haustra.scripts.bench.accuracy.run import chosen_questions, run_questions
        from haustra.scripts.console import progress_bar

        names = chosen_questions(
            () if self.questions == "all" else [name.strip() for name in self.questions.split(",")]
        )
        folder = prepare_folder(self.output) if self.output else None
        effort = Effort(
            quick=self.quick,
            colons=tuple(Path(part) for part in self.colons.split(",") if part),
            rods=self.rods,
            kept=folder,
        )
        with progress_bar("accuracy", len(names), unit="questions") as advance:
            bench = run_questions(names, effort, folder=folder, progress=advance)
        result = bench.to_json()
        if folder:
            write_json(folder / "accuracy.json", result)
        return result if self.json else bars_and_fronts(result)


def bars_and_fronts(result: dict[str, Any]) -> dict[str, Any]:
    """What fits a terminal: the cheapest setting of each front below an error of 1 %, and the criteria."""
    shown: dict[str, Any] = {}
    for front in result["fronts"]:
        points = {point["setting"]: point for point in front["points"]}
        best = [points[name] for name in front["best"]]
        chosen = next((point for point in best if point["error"] <= 0.01), best[-1] if best else None)
        shown[front["question"]] = chosen and f"{chosen['setting']}: {chosen['error']:.2g} at {chosen['cost']:.2g}"
    for criterion in result["criteria"]:
        measured = "nothing" if criterion["measured"] is None else f"{criterion['measured']:.3g}"
        shown[criterion["what"]] = (
            f"{measured} {criterion['unit']}, {criterion['sense']} {criterion['bound']:g}: {criterion['verdict']}"
        )
    return shown
