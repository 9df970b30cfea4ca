"""The page of cohorts in the documentation: `python -m haustra.scripts.bench.pages.cohort_page PAGE COHORT.json…`."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from haustra.envs.view.report.cohort_report import cohort_page, columns, draw_cohort
from haustra.files import write_atomically, write_json
from haustra.reading import read_document

_HEAD = """\
# Validation: a cohort against published colonoscopies

**Question.** Do virtual patients show what published colonoscopies showed, and what of it depends on who drives?

Made by `haustra cohort full -o DIR --device paediatric-long adult` (or `quick`; patients, seconds and seed as said
below) and `python -m haustra.scripts.bench.pages.cohort_page docs/validation/cohort.md DIR/cohort.json`, and kept in
docs/validation/data/cohort.json; edit `scripts/bench/pages/cohort_page.py`, not this page.

**Virtual patients** differ in what [Virtual patients](../how-to/cohort.md) lists, every number drawn from its sourced
range. The hand may push with 100 N and turn with 3 N m, so that peaks are results of the driver. Loops are what the
push made, told against the colon at rest; a loop counts that stands for 5 s in all, and a site as painful that hurts
for so long. Everything counts until the tip is past the valve, P(perforation) too. A scope that leaves the lumen counts
with P(perforation) = 1. The gas in the colon stays as it is: the endoscopist neither insufflates nor sucks.

**What is calibrated.** Friction is drawn from the lower part of its range (0.03 to 0.1). The endoscopist's rules follow
what endoscopists say that they do; its settings were chosen on 16 other patients (seed 2024), the scope by how many
caeca it reaches, all by observables of the half named `choose` in `assets/clinic/observables.toml`. The observables of
the half named `judge` were seen there, but nothing was chosen by them; by the patients below nothing was chosen at all.
The endoscopist's gentle, firm and pulling forces are inputs that its peaks follow from: peaks say little about the
model. What moves the observables is told by [Sobol's indices](causes.md) too.
"""


def validation_page(cohorts: Sequence[Mapping[str, Any]]) -> str:
    """The page, from what `haustra cohort -o DIR` left in each cohort.json."""
    return cohort_page(cohorts, image="../images/cohort.png", head=_HEAD)


def main(page: Path, sources: Sequence[Path]) -> None:
    """Keep the cohorts beside the page, and write page and figure; without sources from what is kept."""
    kept = page.parent / "data" / f"{page.stem}.json"
    if sources:
        write_json(kept, {"cohorts": [read_document(source, "cohort") for source in sources]})
    cohorts = read_document(kept, "cohorts")["cohorts"]
    draw_cohort(page.parent.parent / "images" / "cohort.png", columns(cohorts))
    write_atomically(page, lambda path: path.write_text(validation_page(cohorts), encoding="utf-8"))


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(source) for source in sys.argv[2:]])
