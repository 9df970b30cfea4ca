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

**Claim.** Whether a policy gets stuck, tears or hurts depends on how finely the scope is cut, down to cells of 35 mm in
the shaft and 11 mm in the bending section, and hardly below. Episodes, cohorts and trials have such cells since 24
November 2026.

    haustra bench cells -o DIR

Both policies that insert into colons of any difficulty, an episode in each of {colons} held-out grown colons that move,
the same draws for all; `linear`, {machine}; intervals over colons. *Cells*: longest part without a joint of the shaft
and of the bending section, and distance of the spheres that meet the wall [mm], by steps of 5 ms where nothing is said.
*Cost*: processor time over simulated time, of {colons} scopes side by side. Policies were trained with the coarsest.

| policy, cells | dofs | completion (95 %) | way | P(perforation), mean (95 %) | largest pain | mean force | cost |
|---|---|---|---|---|---|---|---|
"""
_FOUND = """
- A shaft in links of 62.5 mm kinks where a real one bows: a link catches behind a fold of the wall, and lets go in a
  jolt that the hand feels as tens of newtons within a tenth of a second. Then drivers got stuck, and jolts tore walls.
- P(perforation) counts what presses on 25 mm of shaft as one contact (`haustra.models.injury.patch`; the length is
  assumed, 13 to 60 mm), or on one link where links are longer: part of its fall is that, completion and pain are not.
- Spheres are part of the model: each has the wall's stiffness, so that more of them make a stiffer wall.
"""


def cells_page(found: Mapping[str, Any]) -> str:
    """The page as Markdown.

    Args:
        found: `rows` and `machine`, as `haustra bench cells` wrote them.
    """
    rows = found["rows"]
    machine = f"{found['machine']['processor']}, {found['machine']['date']}"
    return _HEAD.format(colons=rows[0]["episodes"], machine=machine) + "".join(map(_row, rows)) + _FOUND


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
        f"{row['pain']:.2f}",
        f"{row['mean_force_N']:.1f} N",
        f"{row['s_per_s']:.2g}",
    )
    return f"| {' | '.join(parts)} |\n"


def main() -> None:
    """Write the page."""
    page, found = map(Path, sys.argv[1:])
    text = cells_page(json.loads(found.read_text(encoding="utf-8")))
    write_atomically(page, lambda place: place.write_text(text, encoding="utf-8"))


if __name__ == "__main__":
    main()
