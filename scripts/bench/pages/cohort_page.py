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

Made by `haustra cohort full --patients 1000 --seed 3 --device adult -o DIR`, `haustra cohort quick --seed 1 --seconds
960 -o DIR` (with drivers and scopes as said below) and `python -m haustra.scripts.bench.pages.cohort_page PAGE
DIR/cohort.json…`, and kept in docs/validation/data/cohort.json; edit `scripts/bench/pages/cohort_page.py`.

**Virtual patients** differ in what [Virtual patients](../how-to/cohort.md) lists, every number drawn from its sourced
range. The hand may push with 100 N and turn with 3 N m, so that peaks are results of the driver. Loops are what the
push made, told against the colon at rest; a loop counts that stands for 5 s in all, and a site as painful that hurts
for so long. Everything counts until the tip is past the valve, P(perforation) too. A scope that leaves the lumen counts
with P(perforation) = 1. The endoscopist has the adult scope of 1.68 m or that of 2 m that the policy knows.

**What is calibrated.** Friction (0.03 to 0.1), the wall's modulus (0.18 to 0.36 MPa), its stiffness when pleated
(0.03 to 0.1 of that) and that of what lies around (0 to 100 N/m²) are drawn from the lower parts of their sourced
ranges. Those parts and the endoscopist's rules and settings were chosen on other patients (seed 7), by how many
observables of the half named `choose` in `assets/clinic/observables.toml` are inside, then by caeca; by the patients
below nothing was chosen. The last choice was among seven endoscopists with 144 patients each, of whom the one that
was kept showed 10 of the 12, and made before those below were examined. That pain must last for 5 s was said after a
first cohort had hurt nearly everybody's sigmoid for an instant. The endoscopist's gentle, firm and pulling forces are
inputs that its peaks follow from: peaks say little about the model. The policy was trained on other colons, with a
shaft as stiff as on the bench, and for nothing on this page but to arrive without tearing or hurting.

**A thousand patients (seed 3, 27 November 2026) show 7 of the 12**: loops, forces over the day's way, strong pushes,
caeca (0.93), straightenings and the share of time with a loop are as in patients. Four hundred others (seed 2, the same
command) show 7, too: their times do not follow loops (0.19), but 0.838 of them loop. On 64 Xeon cores beside four H200,
which were not used, the four hundred took 28 s of growing, 81 s of stepping and 36 s of measuring, in part at the same
time: three minutes of stepping suffice there. On one H200 they do not: it stepped the four hundred in 299 s (growing
49 s, measuring 12 s), and showed 7 of the 12; ten cores took 350 s. The other columns are of 24 patients.

**What changed on 27 November.** Mesenteries hang from their [roots](../theory/mesentery.md#the-patient-around-it):
before, what was gathered was not kept, and 0.62 reached the caecum. And folds on the inside of a bend press on each
other ([mesentery](../theory/mesentery.md#the-model)): before, a gathered colon kinked under a shaft and pinched it by
some hundred newtons with ten at the hand; five of 400 patients bore nearly all of a mean P(perforation) of 0.017.

**What is outside, and why.**

- *Half a metre* of women (0.34), and fewer women than men: rectum, sigmoid and descending colon are as long in both
  sexes here, as sources have them, and what else keeps women's from being straightened no source gives.
- *P(perforation)*, 0.0020 where 0.0020 is the band's end: one patient in a thousand bears half of it, where the colon
  stands beside the shaft in a hairpin; without a descending colon that is mobile it is 0.0030, with one 0.0001.
- *Pain*: the sigmoid hurts 0.80, mostly by the mesentery, for 115 s; the left flexure 0.388, where 0.38 is the band's
  end. In the softest third of the mesentery's range the sigmoid hurts 0.59, which is inside, but the left flexure 0.13,
  which is not; pain is one of those to judge by.
- *Loop and time*: whose sigmoid loops when the tip is at the splenic flexure takes longer (0.24). Pauses that have
  other reasons, which hide that in a clinic, are not there.
- *Peaks*: torque peaks at 0.33 N m, pushes at 17 N, pulls at 9 N; what lies outside the patient is not modelled.

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
