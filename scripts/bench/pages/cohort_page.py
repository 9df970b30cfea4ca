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

**Question.** Do virtual patients, examined by a simulated endoscopist, show what published colonoscopies showed?

Made by `haustra cohort quick -o DIR` (patients and seconds as said below) and `python -m
haustra.scripts.bench.pages.cohort_page DIR PAGE`; edit `scripts/bench/pages/cohort_page.py`, not this page.

**Virtual patients** differ in what [Virtual patients](../how-to/cohort.md) lists, every number drawn from its sourced
range. The hand may push with 100 N and turn with 3 N m, so that peaks are results of the driver. Loops are what the
push made, told against the colon at rest; a loop counts that stands for 5 s in all, and a site as painful that hurts
for so long.

**What is calibrated.** Friction is drawn from the lower part of its range (0.03 to 0.1), and the endoscopist's
settings were tried half a dozen times, by observables of the half named `choose` (any loop, peaks of push and pull,
share of the time above 9.8 N, intubation, straightenings, loops and time), on the very patients below: no others were
left to judge by. That pain must last for 5 s was said after a first cohort had hurt nearly everybody's sigmoid for an
instant. All figures, those of the half named `judge` too, were read meanwhile: that half is no clean test, and other
seeds have to be judged. The endoscopist's gentle, firm and pulling forces are inputs that peaks follow from closely:
peaks say little about the model. Nothing else is calibrated.

**What it shows.** Nine of twelve observables are asked for and not reached: see the table. A driver that pulls back
beyond the tip's place gathers the colon on the shaft, as endoscopists do; but most insertions are still under way
when their time ends, so that what is counted at the caecum rests on few patients. Peaks of 100 N and 3 N m in earlier
cohorts were numerical: contacts on a much gathered colon trembled until the scope left the lumen
([mesentery](../theory/mesentery.md)). A scope that leaves it (`escaped`) counts with P(perforation) = 1.
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
