"""Write the validation page of the cable from what its tests and benchmarks measured.

python -m pytest tests/physics tests/envs/{statics,engine,measure} --junitxml=physics.xml -o junit_family=xunit1
haustra bench rods DIR --json > rods.json
haustra bench cost --colon DIR --json > cost.json
python -m haustra.scripts.bench.pages.cable_page physics.xml rods.json cost.json docs/validation/cable.md
"""

import json
import re
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from haustra.files import write_atomically

_HEAD = """\
# Validation: the cable

**Claim.** The cable that stands for a scope's shaft follows beam theory within the bounds below, and published rods
within 0.05 % of their length; 40 joints run faster than real time. What is modelled is in
[the theory](../theory/cable.md).

    haustra bench rods FOLDER --json
    haustra bench cost --colon COLON --json
    python -m pytest tests/physics

This page is made by `haustra.scripts.bench.pages.cable_page` from the figures that tests and benchmarks record.

"""

_PEERS = {25: (0.67, 0.092), 50: (0.19, 0.32), 100: (0.10, 1.75)}
"""Mean tip error [% of length] and seconds a shape of the best open model (OpenCR-MuJoCo), measured by us before."""

_RODS = """\
## Measured rods

500 static shapes and six tip releases of a spring-steel rod, computed by SoroSim and published with OpenCR-MuJoCo, by
`haustra bench rods`. Errors are fractions of the rod's length; an exact inextensible rod scores 0.026 % on the shapes,
which is the data's own floor. *Order* is that of the cable itself, against its finest row. The other model's figures
(OpenCR-MuJoCo) were measured on the same machine.

| joints | mean tip error | largest | s a shape | order | other model: mean tip error | s a shape |
|---|---|---|---|---|---|---|
"""

_RELEASES = """\

Six releases, steps of 3 ms: the largest error over the recorded 10 s, and the smallest real-time factor of one core.

| joints | middle, rms | tip, rms | tip, mean | real-time factor |
|---|---|---|---|---|
"""

_COST = """\

## Cost

Steps of 4 ms a second, one core, all in one run; in brackets the real-time factor. The cable in its colon is pushed at
4 cm/s for the first seconds of an insertion.

| joints | cable | cable with linear hinges | plugin cable | plain chain | cable in a colon (contacts) |
|---|---|---|---|---|---|
"""

_PROOFS = """\

## Theory

Of figures that differ only in their numbers or directions the one that is furthest off is shown, with their count.

| criterion | measured | theory | off by | bound |
|---|---|---|---|---|
"""


def cable_page(figures: list[list[str]], rods: dict[str, Any], cost: dict[str, Any]) -> str:
    """The page as Markdown."""
    parts = [_HEAD, _RODS, *_statics(rods), _RELEASES, *_releases(rods), _COST, *_cost(cost), _PROOFS]
    for what, measured, theory, error, bound in worst_of_each_kind(figures):
        parts.append(f"| {what} | {measured} | {theory} | {float(error):.2%} | {float(bound):.2%} |\n")
    return "".join(parts)


def worst_of_each_kind(figures: list[list[str]]) -> list[list[str]]:
    """Figures that differ only in numbers and quoted names as one: that with the largest error, and their count."""
    kinds: dict[str, list[list[str]]] = {}
    for figure in figures:
        kinds.setdefault(re.sub(r"'[^']*'|\d[\d.]*", "#", figure[0]), []).append(figure)
    worst = []
    for members in kinds.values():
        what, *rest = max(members, key=lambda figure: float(figure[3]))
        worst.append([f"{what} (worst of {len(members)})" if len(members) > 1 else what, *rest])
    return worst


def read_figures(path: Path) -> list[list[str]]:
    """Figures that tests recorded, in the order of the tests."""
    found = ElementTree.parse(path).iterfind(".//property[@name='figure']")
    return [str(entry.get("value")).rsplit("|", 4) for entry in found]


def _statics(rods: dict[str, Any]):
    for row, cost in zip(rods["rows"], rods["cost"], strict=True):
        order = f"{cost['observed_order']:.2f}" if cost["observed_order"] else "–"
        error, seconds = _PEERS.get(row["joints"], (None, None))
        peer = f"{error:.2f} % | {seconds:.2g}" if error else "– | –"
        yield (
            f"| {row['joints']} | {100 * row['statics_mean_tip_error']:.3f} % | "
            f"{100 * row['statics_max_tip_error']:.3f} % | {cost['seconds_per_shape']:.3f} | {order} | {peer} |\n"
        )


def _releases(rods: dict[str, Any]):
    for row, cost in zip(rods["rows"], rods["cost"], strict=True):
        middle, tip = (max(each[name] for each in row["dynamics"]) for name in ("mid_rms", "tip_rms"))
        mean, factor = max(cost["tip_means"]), min(cost["real_time_factors"])
        yield f"| {row['joints']} | {100 * middle:.3f} % | {100 * tip:.3f} % | {100 * mean:.3f} % | {factor:.1f} |\n"


def _cost(cost: dict[str, Any]):
    def cell(entry: dict[str, Any]) -> str:
        return f"{entry['steps_per_s']:,.0f} ({entry['real_time_factor']:.1f})"

    inside = cost.get("in_colon", [None] * len(cost["alone"]))
    for row, colon in zip(cost["alone"], inside, strict=True):
        last = f"{cell(colon)}, {colon['contacts_mean']:.1f} contacts" if colon else "–"
        bases = " | ".join(cell(row[kind]) for kind in ("hinges", "linear hinges", "cable plugin", "plain chain"))
        yield f"| {row['joints']} | {bases} | {last} |\n"


if __name__ == "__main__":
    physics, rods_file, cost_file, target = map(Path, sys.argv[1:])
    page = cable_page(read_figures(physics), json.loads(rods_file.read_text()), json.loads(cost_file.read_text()))
    write_atomically(target, lambda temporary: temporary.write_text(page, encoding="utf-8"))
