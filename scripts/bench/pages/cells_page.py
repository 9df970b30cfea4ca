"""The page of what finer scopes do to the same episodes.

`python -m haustra.scripts.bench.pages.cells_page docs/validation/cells.md docs/validation/data/cells.json`.
"""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from haustra.files import write_atomically

_HEAD = """\
# Cells of a scope, and what comes of an insertion

**Claim.** With the coarsest scope `{driver}` arrives in {worst:.2f} of episodes, with finer ones in {low:.2f} to
{high:.2f}; with it pain is largest, too, and the mean P(perforation). Among the finer ones completion, pain and
P(perforation) are alike within their intervals; only forces go on falling. Episodes have cells of 35 mm in the shaft
and 11.4 mm in the bending section since 24 November 2026.

    haustra bench cells --drivers {driver} -o DIR

An episode in each of {colons} held-out grown colons of any difficulty that move, the same draws for all; `linear`,
{machine}; intervals over colons. *Cells*: longest part without a
joint of the shaft and of the bending section, and distance of the spheres that meet the wall [mm], by steps of 5 ms
where nothing is said. The policy was trained with the coarsest. The page is made from docs/validation/data/cells.json
by `scripts/bench/pages/cells_page.py`.

| policy, cells | dofs | completion (95 %) | way | P(perforation) (95 %) | largest pain (95 %) | mean force (95 %) |
|---|---|---|---|---|---|---|
"""
_FOUND = """
- Spheres decide most of completion: on the same links, spheres every 8.4 mm instead of 31.5 mm do what finer links do.
  Presumably a fold between two spheres holds the scope and lets it go in a jolt; that was not looked at by itself.
- Finer links lower the mean force still at the finest: it is no figure of this scope alone, but of it and its cells.
  Half the time step changes nothing that the intervals show.
- P(perforation) counts what presses on 25 mm of shaft as one contact (`haustra.models.injury.patch`; the length is
  assumed, 13 to 60 mm), or on one link where links are longer: part of its fall is that, completion and pain are not.
- Spheres are part of the model: each has the wall's stiffness, so that more of them make a stiffer wall.
"""


def cells_page(found: Mapping[str, Any]) -> str:
    """The page as Markdown.

    Args:
        found: `rows` and `machine`, as `haustra bench cells` wrote them; the first row is that of the coarsest scope.
    """
    rows = found["rows"]
    finer = [row["completion"] for row in rows[1:] if row["driver"] == rows[0]["driver"]]
    said = {"driver": rows[0]["driver"], "worst": rows[0]["completion"], "low": min(finer), "high": max(finer)}
    machine = f"{found['machine']['processor']}, {found['machine']['date']}"
    return _HEAD.format(**said, colons=rows[0]["episodes"], machine=machine) + "".join(map(_row, rows)) + _FOUND


def _row(row: Mapping[str, Any]) -> str:
    def between(name: str, form: str) -> str:
        low, high = row[f"{name}_95"]
        return f"{row[name]:{form}} ({low:{form}}–{high:{form}})"

    parts = (
        f"`{row['driver']}`, {row['cells']}",
        f"{row['dofs']}",
        between("completion", ".3g"),
        f"{row['progress']:.3f}",
        between("p_perforation", ".2g"),
        between("pain", ".2f"),
        between("mean_force_N", ".1f") + " N",
    )
    return f"| {' | '.join(parts)} |\n"


def main() -> None:
    """Write the page."""
    page, found = map(Path, sys.argv[1:])
    text = cells_page(json.loads(found.read_text(encoding="utf-8")))
    write_atomically(page, lambda place: place.write_text(text, encoding="utf-8"))


if __name__ == "__main__":
    main()
