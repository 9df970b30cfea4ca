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

**What is calibrated.** Friction (0.03 to 0.1), the wall's modulus (0.18 to 0.36 MPa), its stiffness when pleated
(0.03 to 0.1 of that) and that of what lies around (0 to 100 N/m²) are drawn from the lower parts of their sourced
ranges. Those parts and the endoscopist's rules and settings were chosen on other patients (seed 7), by how many
observables of the half named `choose` in `assets/clinic/observables.toml` are inside, then by caeca; by the patients
below nothing was chosen. The last choice was among seven endoscopists with 144 patients each, and made before the
four hundred were examined. That pain must last for 5 s was said after a first cohort had hurt nearly everybody's
sigmoid for an instant. The endoscopist's gentle, firm and pulling forces are inputs that its peaks follow from: peaks
say little about the model. The policy was trained on other colons, with a shaft as stiff as on the bench, and for
nothing on this page but to arrive without tearing or hurting.

**Four hundred patients (seed 1, 27 November 2026) show 6 of the 12**: loops, forces over the day's way, strong
pushes, caeca (0.92) and the share of time with a loop are as in patients. On 64 Xeon cores beside four H200, which
were not used, growing took 31 s, stepping 85 s and measuring 49 s, in part at the same time: three minutes of stepping
suffice there. On one H200 the same was stopped after 461 s without an end on 26 November; ten cores took 350 s. The
other columns are of 24 patients.

**What changed since 26 November**, when 0.62 reached the caecum: mesenteries hang from their
[roots](../theory/mesentery.md#the-patient-around-it). Before, a sigmoid that bows by more than its mesentery is high
was drawn into its bow again as soon as nobody pulled, at no push at all, and what was gathered was not kept. With
today's endoscopist and ranges `haustra cohort quick --patients 48 --seed 7 --seconds 960 --device adult` reaches 0.88
of caeca, and with `--no-rooted` 0.65; 0.33 of men, 0.17 of women are at the splenic flexure with half a metre inside,
and 0.12, 0.08 (two shared Xeon cores).

**What is outside, and why.**

- *Half a metre* (men) and *straightenings*: this endoscopist straightens after 0.3 m of new colon; after 0.2 m, seed
  7 showed 0.36 of men, 0.29 of women and 7 straightenings, but strong pushes for 0.009 of the time.
- *P(perforation)*: five of the four hundred bear nearly all of it. Where the shaft lies straight in a gathered
  sigmoid, single links at its ends are pressed by 30 to some hundred newtons for tenths of a second, with 9 to 17 N
  at the hand (trial: eight of the worst, examined again). That is more than the hand gives, and a weakness of contacts
  in packed folds.
- *Pain*: the sigmoid hurts 0.79, mostly by the mesentery, for 137 s. In the softest third of the mesentery's range it
  hurts 0.59, which is inside, but the left flexure 0.12, which is not; pain is one of those to judge by.
- *Loop and time*: whose sigmoid loops when the tip is at the splenic flexure takes longer (0.32). Pauses that have
  other reasons, which hide that in a clinic, are not there.
- *Peaks*: torque peaks at 0.35 N m, pushes at 20 N; what lies outside the patient is not modelled.

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
