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

Made by `haustra cohort full --seed 1 --device adult -o DIR`, `haustra cohort quick --seed 1 --seconds 960 -o DIR` (with
drivers and scopes as said below) and `python -m haustra.scripts.bench.pages.cohort_page PAGE DIR/cohort.json…`, and
kept in docs/validation/data/cohort.json; edit `scripts/bench/pages/cohort_page.py`, not this page.

**Virtual patients** differ in what [Virtual patients](../how-to/cohort.md) lists, every number drawn from its sourced
range. The hand may push with 100 N and turn with 3 N m, so that peaks are results of the driver. Loops are what the
push made, told against the colon at rest; a loop counts that stands for 5 s in all, and a site as painful that hurts
for so long. Everything counts until the tip is past the valve, P(perforation) too. A scope that leaves the lumen counts
with P(perforation) = 1. The endoscopist has the adult scope of 1.68 m or that of 2 m that the policy knows.

**What is calibrated.** Friction (0.03 to 0.1), the wall's modulus (0.18 to 0.36 MPa) and its stiffness when pleated
(0.03 to 0.3 of that) are drawn from the lower parts of their sourced ranges. Those parts and the endoscopist's rules
and settings were chosen on 24 other patients (seed 7), by how many observables of the half named `choose` in
`assets/clinic/observables.toml` are inside, then by caeca; by the patients below nothing was chosen. The observables of
the half named `judge` were read on those 24, but nothing was chosen by them. That pain must last for 5 s was said after
a first cohort had hurt nearly everybody's sigmoid for an instant. The endoscopist's gentle, firm and pulling forces are
inputs that its peaks follow from: peaks say little about the model. The policy was trained on other colons, with a
shaft as stiff as on the bench, and for nothing on this page but to arrive without tearing or hurting.

**Four hundred patients (seed 1, 26 November 2026) show 7 of the 12**: loops, forces over the day's way, straightenings
and the share of time with a loop are as in patients; half a metre, peaks, caeca (0.62), pain and P(perforation) are
not. Ten Xeon cores grew them in 91 s and examined them in 350 s, 114 s of which were measuring. On one H200 the same
was stopped after 461 s without an end, with five cores to grow on; the aim, three minutes of stepping, is not met by
either. The two other columns below are of 24 patients and the day before.

| 24 patients, seed | inside | caecum | P(perforation) | sigmoid, right, left hurt | half a metre: men, women |
|---|---|---|---|---|---|
| 1 | 9 | 0.92 | 0.001 | 0.92, 0.42, 0.46 | 0.17, 0.25 |
| 7 (chosen by) | 6 | 0.62 | 0.0028 | 0.92, 0.25, 0.42 | 0.17, 0.08 |
| 11 | 6 | 0.71 | 0.046 | 0.83, 0.29, 0.50 | 0.33, 0.33 |
| 33 | 5 | 0.54 | 0.001 | 0.75, 0.29, 0.42 | 0.17, 0.17 |

24 patients each, adult scope, 960 s (`haustra cohort quick --seed SEED --seconds 960 --device adult`, two shared EPYC
cores, 25 November 2026, before shafts stayed threaded when pulled taut). One more who reached the caecum made 9 of 7 on
seed 1: it was luck. The endoscopist pushes gently (8 N, 1 N more a second) and pulls with 17 N, as far as 0.6 m.

**What stays outside has one cause: what is gathered is not kept.** In trials with the eight longest colons of seed 7, a
pull of 1 to 5 N takes the shaft in the sigmoid from 0.55 m to 0.25 to 0.35 m while the tip stands, and shaft over colon
passed from 1.0 to 0.62. Then the scope goes on, and the sigmoid takes 0.5 m of shaft again at 3 to 7 N, while less than
1 N comes to the tip, which nothing holds. A shaft that still bows by 0.3 m between ends 0.17 m apart gives way at 2 N
(Euler's load of EI 0.027 N m²); a straight one would bear 7 to 27 N. So at the caecum shaft and colon passed are equal
(1.04), tips of those who fail stand at 0.9 to 0.95 of the colon's length, and sigmoids hurt. Caeca are reached in 41 of
41 colons shorter than 1.5 m, in 0.71 up to 1.6 m, 0.21 up to 1.7 m and none of ten longer ones (four seeds). The
softest colon of the ranges, surroundings at the firm end of theirs (700 N/m²), a mesentery of 20 cm and pulls of a
minute bring the same eight no further. That folds lie against each other at 0.35 of the sigmoid's length is assumed,
and was not varied. Torque peaks at 0.35 N m; what lies outside the patient is not modelled.

What was tried and not kept stands in the [log](../log/navigation.md#endoscopists-that-were-tried).
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
