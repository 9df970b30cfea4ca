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

Made by `haustra cohort quick -o DIR` (drivers, patients, seconds and seed as said below) and `python -m
haustra.scripts.bench.pages.cohort_page docs/validation/cohort.md DIR/cohort.json`, and kept in
docs/validation/data/cohort.json; edit `scripts/bench/pages/cohort_page.py`, not this page.

**Virtual patients** differ in what [Virtual patients](../how-to/cohort.md) lists, every number drawn from its sourced
range. The hand may push with 100 N and turn with 3 N m, so that peaks are results of the driver. Loops are what the
push made, told against the colon at rest; a loop counts that stands for 5 s in all, and a site as painful that hurts
for so long. Everything counts until the tip is past the valve, P(perforation) too. A scope that leaves the lumen counts
with P(perforation) = 1. The endoscopist has the adult scope of 1.68 m, the policy that of 2 m that it was trained with.

**What is calibrated.** Friction is drawn from the lower part of its range (0.03 to 0.1), and the endoscopist's rules
and settings were chosen on 24 other patients (seed 7), by observables of the half named `choose` in
`assets/clinic/observables.toml`, with the scope `paediatric-long`; by the patients below nothing was chosen. The
observables of the half named `judge` were read on those 24, but nothing was chosen by them. That pain must last for 5 s
was said after a first cohort had hurt nearly everybody's sigmoid for an instant. The endoscopist's gentle, firm and
pulling forces are inputs that its peaks follow from: peaks say little about the model. The policy was trained on other
colons, at the rates of a person's hand, and for nothing on this page but to arrive without tearing or hurting.

**What it shows.** With scopes cut into cells of 25 mm ([why](cells.md)) nobody pushes too hard for too long any more:
what looked like a driver's haste were links that caught behind folds. The endoscopist with the adult scope then has
loops, their kinds and their share of the time, straightenings, the time of strong pushing, the rise of force and the
independence of loops and times as published. **What stays outside points to one cause: the colon is not gathered far
enough.** Past half a metre the shaft inside falls to 0.8 of the colon passed, and 1.4 m are inside at the caecum, where
clinics are said to have half of that; so half a metre of shaft hardly ever reaches the splenic flexure, a scope of
1.68 m does not suffice in long colons (one of 2 m always does), and mesenteries are stretched until they hurt. Single
jams make P(perforation); the policy with its own scope has none. N = 400 was not examined.

**Other patients show less.** 24 more, on whom nothing was chosen either (`haustra cohort quick --seed 33 --seconds
960`, 25 November 2026, 63 s on two quiet cores), match **4 of 12** with the endoscopist and the adult scope: 0.42 reach
the caecum, 0.71 have a loop, the hardest push is 26 N, and 8.7 % would be torn. So the table below is the better of two
draws.

**What was tried.** An endoscopist who feels a loop by shaft that adds up beyond the lumen, pulls with 17 N as long as
it gathers more than it loses, holds the torque, pushes hard at no wall and never gives up brought 3 of 16 tips to the
splenic flexure with half a metre inside (seed 2024, 600 s, adult scope), against none, but only 5 to the caecum instead
of 8. With less pull, and no lumen let go, none and 10. With the scope of 2 m and 16 more patients (seed 32, 600 s) that
one came to 11 caeca, the endoscopist of this page to 14, with mean P(perforation) of 0.076 against 0.004. So it was not
kept, by the share of caeca. Walls were most at risk under the shaft, 0.3 to 1.4 m behind the tip, not under the tip:
pushing no wall with the tip spares nobody. What gathers the colon is lost again as the scope goes on.
On those other patients the endoscopist of this page has 4 of 12 observables inside with the adult scope (seed 2024) and
5 with that of 2 m (seed 32): 16 patients resolve no loop's share, and have no correlation to be told.
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
