"""Write the documentation page of the errors that runs state.

`python -m haustra.scripts.bench.pages.errors_page docs/validation/errors.md`.
"""

import sys
from itertools import groupby
from pathlib import Path

from haustra.assets import asset
from haustra.files import write_atomically
from haustra.models.accuracy import Measured, Range, load_measured

_HEAD = """\
# What every run states as its error

**Claim.** `scores.json` states how far its answers are off by numerics alone, as ranges over ten colons and more, for
the wall law, preset and kind of colon of the run; `haustra run --error` measures a run's own. Nothing below says how
far the physics is from a patient.

    haustra bench errors --walls prism,coacd --folders EdinGCA_3D_00020,HuBMAPVHM_3D_00070 --ship -o DIR

One script of hand and wires a colon and scope, recorded from the lumen follower, drives every model, and a converged
one with more joints and shorter time steps: tangent planes where colons are fixed, the table of the lumen where they
move. A coarser one says how converged that is; where a range is not above that, the reference itself is the limit.
Forces are means over the script, tips the median distance from the reference's path. Two real colons are public, so
their rows span the ten grown ones too. Which cells and time steps buy what is on
[another page](accuracy.md). This page is generated from assets/accuracy.toml by `make docs`.
"""
_KINDS = {"grown": "Grown colons", "real": "Real and grown colons"}


def errors_page() -> str:
    """The page as Markdown."""
    parts = [_HEAD]
    entries = sorted(load_measured(asset("accuracy.toml")), key=lambda each: (each.colon, each.mesentery))
    for (kind, moves), group in groupby(entries, key=lambda each: (each.colon, each.mesentery)):
        parts.append(_section(f"{_KINDS[kind]}, {'on their mesentery' if moves else 'fixed'}", list(group)))
    return "\n".join(parts)


def _section(title: str, entries: list[Measured]) -> str:
    rows = "".join(
        f"| {' of '.join(part for part in (each.wall_law, each.wall) if part)} | `{each.preset}` | "
        f"{_percent(each.error.wall_force)} | {_percent(each.error.push)} | {_millimetres(each.error.tip_mm)} |\n"
        for each in entries
    )
    head = f"## {title}\n\n| wall law | preset | wall force | push | tip [mm] |\n|---|---|---|---|---|\n"
    laws = {}
    for each in entries:
        law = " of ".join(part for part in (each.wall_law, each.wall) if part)
        laws.setdefault(each.error.measured_on, []).append(law)
    said = [f"{_listed(own) if len(laws) > 1 else 'All rows'}: {source}." for source, own in laws.items()]
    return f"{head}{rows}\n" + "\n\n".join(said) + "\n"


def _listed(laws: list[str]) -> str:
    text = ", ".join(dict.fromkeys(laws))
    return text[0].upper() + text[1:]


def _percent(ends: Range) -> str:
    low, high = (100 * float(end or 0.0) for end in ends)
    return f"{low:.2g} to {high:.3g} %"


def _millimetres(ends: Range) -> str:
    low, high = (float(end or 0.0) for end in ends)
    return f"{low:.2g} to {high:.2g}"


if __name__ == "__main__":
    page = errors_page()
    write_atomically(Path(sys.argv[1]), lambda path: path.write_text(page, encoding="utf-8"))
