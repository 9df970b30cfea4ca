"""The page of a cohort in the documentation: `python -m haustra.scripts.bench.pages.cohort_page STORE PAGE`."""

import json
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from haustra.envs.study.cohort_table import observables, rows_of
from haustra.envs.study.store import read_store
from haustra.envs.view.report.cohort_report import causes_table, cohort_page, draw_cohort
from haustra.files import write_atomically

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


_PASSED = 0.5
"""Colon passed from which on gathering is told of [m]."""


def _least_shaft(curves: Mapping[str, list[float]]) -> float | None:
    """Least shaft inside over colon passed of a run, past `_PASSED` [1]; None of one that did not come so far."""
    arc, shaft = (np.array(curves.get(name, [])) for name in ("tip_arc_m", "insertion_m"))
    far = arc > _PASSED
    return float((shaft[far] / arc[far]).min()) if far.any() else None


def main(store: Path, page: Path) -> None:
    """Write the page of a store, and its figure beside the documentation's pictures."""
    with read_store(store) as jobs:
        conditions = jobs.study.conditions
        found = {
            (str(driver), str(device)): observables(rows_of(jobs, driver=str(driver), device=str(device)))
            for driver in conditions["driver"]
            for device in conditions["device"]
        }
        about = {"patients": jobs.study.sampler.count, "study": jobs.study.hash, "jobs": jobs.counts()}
        first = next(iter(found))
        moved = causes_table(jobs, found[first], driver=first[0], device=first[1])
        gathered = [least for job in jobs.rows() if (least := _least_shaft(job["curves"])) is not None]
        seconds = json.dumps(jobs.study.options["seconds"])
    image = page.parent.parent / "images" / "cohort.png"
    draw_cohort(image, found)
    head = _HEAD + f"\nAt most {seconds} s a patient (`--patients {about['patients']} --seconds {seconds}`).\n"
    if gathered:
        shares = f"{np.median(gathered):.2f} (median) and {min(gathered):.2f} (least)"
        head += f"Past half a metre of colon, shaft inside over colon passed fell to {shares}.\n"
    text = cohort_page(found, about, image=f"../images/{image.name}", head=head)
    write_atomically(page, lambda path: path.write_text(text + moved, encoding="utf-8"))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
