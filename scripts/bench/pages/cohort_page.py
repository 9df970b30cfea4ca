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
observables of the half named `judge` were read on those 24, but nothing was chosen by them. How much shaft it spares,
how far it turns and swings it and how many attempts it makes were chosen again on seed 7, with the adult scope, by the
share of caeca alone. That pain must last for 5 s
was said after a first cohort had hurt nearly everybody's sigmoid for an instant. The endoscopist's gentle, firm and
pulling forces are inputs that its peaks follow from: peaks say little about the model. The policy was trained on other
colons, at the rates of a person's hand, and for nothing on this page but to arrive without tearing or hurting.

**What it shows.** The endoscopist reaches nine caeca in ten of these patients, as clinics do, with the adult scope too;
the kinds of loops, their share of the time, straightenings, the time of strong pushing and the rise of force are as
published. **What stays outside has two causes. The colon is not gathered far enough:** pulled back, the shaft inside
falls to 0.8 of the colon passed, but as the scope goes on each segment takes in again as much shaft as it is long at
rest, and at the caecum shaft and colon passed are equal (0.98 of the whole length, mean of seeds 7, 11 and 33). So the
caecum is reached in 0.97 of colons shorter than 1.5 m, 0.67 up to 1.6 m, 0.29 up to 1.7 m and in none of nine longer
ones; half a metre hardly ever reaches the splenic flexure, and sigmoids hurt. **And scopes leave the rectosigmoid bend
on its inside** ([known limits](../limits.md)) in 5 of 72: each counts as torn. Without those the mean P(perforation) is
0.0005, inside its band. N = 400 was not examined.

**Other patients show less.** 24 each, adult scope, 960 s (`haustra cohort quick --seed SEED --seconds 960`, 25 November
2026, two shared EPYC cores beside other work). *Before* is the endoscopist of before; for seed 7 with the hand on the
belly of before ([mesentery](../theory/mesentery.md)), too. *Now* with 1 N m as limit of torque for seeds 11 and 33.

| seed | inside, before and now | caecum | torn | sigmoid, right, left hurt | half a metre, men, women |
|---|---|---|---|---|---|
| 7 (settings were chosen by its caeca) | 6, 5 | 0.46, 0.58 | 0.084, 0.042 | 0.88, 0.38, 0.46 | 0.08, 0.08 |
| 11 | 5, 5 | 0.67, 0.75 | 0.083, 0.13 | 0.83, 0.33, 0.46 | 0, 0 |
| 33 | 4, 4 | 0.42, 0.54 | 0.084, 0.042 | 0.75, 0.29, 0.46 | 0, 0.08 |

Caeca are more in every draw. The endoscopist of before had 7 of 12 inside on the patients of the table below: now caeca
are inside, and any loop (20 of 24, not 21) and the correlation (0.21, not 0.11) are outside.

**What would have to be.** For nine caeca in ten with 1.68 m in colons of up to 1.75 m, 0.94 of the colon passed would
have to be inside. The mesentery's nominal modulus and pleating bring a quarter of men and women to the splenic flexure
with half a metre (seed 7, pulls to 17 N, hand of before), but then 7 of 24 scopes leave the rectosigmoid bend. Torque
peaks at 0.39 to 0.47 N m; why it is less than a clinic's was not found.

**What was tried** before and not kept stands in the [log](../log/navigation.md#endoscopists-that-were-tried).
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
