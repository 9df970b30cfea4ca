"""Write a page of Sobol's indices of a patient's numbers from what `haustra sensitivity STUDY -o DIR` leaves.

`python -m haustra.scripts.bench.pages.causes_page docs/validation/causes.md DIR/sensitivity.json` after
`cohort-causes`, and with `docs/validation/injury-causes.md` after `injury-causes`.
"""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from haustra.envs.study.cohort import SCORES
from haustra.envs.study.study_file import load_study
from haustra.files import write_atomically, write_json
from haustra.reading import read_document

STUDIES = {"causes": "cohort-causes", "injury-causes": "injury-causes"}
"""Study of each page."""
_TITLES = {
    "causes": (
        "what moves the cohort",
        "Which numbers that nobody measured in this patient make what her colonoscopy shows?",
    ),
    "injury-causes": (
        "what moves harm, pain and reach",
        "Which assumed numbers make how likely a wall is torn, how much it hurts, and how far a scope comes?",
    ),
}
_MOST = 3
_HEAD = """\
# Validation: {title}

**Question.** {question}

Made by `haustra sensitivity {name} --backend linear -o DIR` and `python -m
haustra.scripts.bench.pages.causes_page docs/validation/{page}.md DIR/sensitivity.json`, and kept in
docs/validation/data/{page}.json; do not edit.

One colon, a woman's of seed {seed:.0f}, is examined by the driver `{driver}` with the scope `{device}` for at most
{seconds:g} s, by Saltelli's sample of {count} points: {designs} examinations. What differs are the {variables} numbers
{which}: those of patients (`assets/clinic/patients.toml`){injury}, each within
its sourced range. ST is the share of a score's variance that a number makes alone and with others, S1 that which it
makes alone; in brackets half the width of the {confidence:.0%} interval. Shares of a score that jumps (0 or 1), and of
a course that small changes upset, are mostly of the second kind: ST of several numbers is then large together, and S1
small.

{missing}

| score | number | ST | S1 |
| --- | --- | --- | --- |
"""
_TAIL = """
Told are the {most} numbers with the largest ST of each score, where its interval excludes 0. A score that is not
listed did not vary, or no number was told apart.

**What it does not tell.** Another colon may have other causes: length, diameters and course are those of one. The
driver's settings are not varied, nor are the numbers of the scope{within}; [the cohort](cohort.md) varies the
colon too.
"""
_WITHIN = """, nor those of injury that act within a run
(strengths by shape of head, size, length of a contact), whose ranges are in [numbers](../numbers.md)"""
_WITHOUT_EFFECT = """, nor numbers that do nothing
here: age, whose effect no source gives; what bursts under gas, since none is let in; envelope, breath and loops that
touch, which these patients' abdomens are without; the wall's density, since they lie on the back and as they were
imaged; and what makes mucosa bleed, which no score of an examination counts"""
_GROWN = "patient.gas_pressure"


def causes_page(kept: Mapping[str, Any], *, page: str = "causes") -> str:
    """The page of a study's sensitivity.json, by its name in `STUDIES`."""
    study = load_study(STUDIES[page])
    names = {each["variable"] for each in kept["indices"]}
    count, variables = study.sampler.count, len(names)
    title, question = _TITLES[page]
    varied = {v.path for v in study.variables if v.column in names}
    torn, moves = (any(path.startswith(room) for path in varied) for room in ("injury.", "mesentery."))
    within = "injury.contact_length" in varied
    more = " and of what tears (`assets/numbers/injury.toml`)" if torn else ""
    more += "\nand of how colons move (`assets/numbers/mesentery.toml`)" if moves else ""
    left_out = kept["points_left_out"]
    head = _HEAD.format(
        name=STUDIES[page],
        page=page,
        title=title,
        question=question,
        injury=more,
        driver=study.conditions["driver"][0],
        seed=study.changes["patient.seed"],
        device=study.conditions["device"][0],
        seconds=study.options["seconds"],
        count=count,
        designs=count * (variables + 2),
        variables=variables,
        which="that may act, with colons grown anew for gas pressure and sigmoid"
        if _GROWN in varied
        else "that need no new colon",
        confidence=kept["confidence"],
        missing=f"{left_out:.0%} of the points are left out, since an examination of theirs has no number."
        if left_out
        else "Every examination came to its end.",
    )
    meanings = {column.name: column.meaning for column in SCORES}
    rows = []
    for score in study.scores or ():
        own = [each for each in kept["indices"] if each["score"] == score and each["total"] > each["total_confidence"]]
        for each in sorted(own, key=lambda one: -one["total"])[:_MOST]:
            total = f"{each['total']:.2f} (± {each['total_confidence']:.2f})"
            first = f"{each['first']:.2f} (± {each['first_confidence']:.2f})"
            rows.append(f"| {meanings[score]} | {each['variable']} | {total} | {first} |\n")
    left = _WITHOUT_EFFECT if within else _WITHIN if torn else ""
    return head + "".join(rows) + _TAIL.format(most=_MOST, within=left)


def main(page: Path, sources: Sequence[Path]) -> None:
    """Keep the indices beside the page, and write it; without a source from what is kept."""
    kept = page.parent / "data" / f"{page.stem}.json"
    for source in sources:
        write_json(kept, read_document(source, "indices"))
    text = causes_page(read_document(kept, "indices"), page=page.stem)
    write_atomically(page, lambda file: file.write_text(text, encoding="utf-8"))


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(source) for source in sys.argv[2:]])
