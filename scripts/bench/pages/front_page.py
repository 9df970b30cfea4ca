"""Write the page on run time against error in linear time, and its picture.

haustra bench front -o DIR; cp DIR/front.json docs/validation/data/accuracy.json
python -m haustra.scripts.bench.pages.front_page docs/validation/data/accuracy.json docs/validation/accuracy.md
docs/images/front.png
"""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

from haustra.files import write_atomically
from haustra.models.presets import PRESETS
from haustra.scripts.bench.accuracy.front import COARSER, REFERENCE, best

_HEAD = """\
# Validation: run time against error

**Claim.** Which cells, spheres and time steps buy most accuracy in linear time, and what the presets are chosen by.

    haustra bench front -o DIR

One script of hand and wires a colon and scope, recorded from the lumen follower, drives every way of modelling and a
converged one, all against the table of the lumen, so that errors are of cells, spheres and time steps alone. Errors are
medians over colons and scopes, the largest in brackets: of the mean push, of the mean sum of wall forces, and the
median distance of the tip. *Cost* is processor time over simulated time of one scope that is alone, from where its
script ended; 0.01 is a hundred times real time. What the wall's law adds, and ranges over colons, are what
[runs state as their error](errors.md). Fronts of rods, of tubes and of walls of pieces are
[older](../log/accuracy.md). This page is made by `haustra.scripts.bench.pages.front_page`; edit that, not this page.

"""
_FOUND = """\
- **In fixed colons joints are what counts.** From cells of 50 and 17 mm, the defaults against pieces, to 25 and 8.5 mm,
  of `balanced`, errors of tips fall to a third; shorter time steps take nothing away.
- **In colons that move the time step is what counts.** Errors of push and wall force fall with it, at nearly any cells;
  presumably since the axis of the colon gives way by a bound of its springs' stiffness, which holds it up in proportion
  to the step. Joints cost little there, since most of a step is the colon's.
- **Spheres** are part of the model: each has the wall's stiffness, so that more on a length make a stiffer wall.
- **Twist** needs no more than the default hinges.

"""
_KINDS = {False: "In fixed colons", True: "In colons on their mesentery"}
_QUANTITIES = {"push": ("push", 100), "wall_force": ("wall force", 100), "tip_mm": ("tip", 1)}


def front_page(kept: Mapping[str, Any]) -> str:
    """The page as Markdown."""
    rows, machine = kept["rows"], kept["machine"]
    parts = [_HEAD, _where(rows, machine), _FOUND, _presets(rows), "\n![Push error over cost](../images/front.png)\n"]
    parts += [_section(title, [row for row in rows if row["mesentery"] == hung]) for hung, title in _KINDS.items()]
    return "".join(parts).rstrip() + "\n"


def _where(rows: Sequence[Mapping[str, Any]], machine: Mapping[str, Any]) -> str:
    floor = {row["mesentery"]: row for row in rows if row["setting"] == COARSER}
    said = "; ".join(
        f"{100 * row['push']:.2g} % of push, {100 * row['wall_force']:.2g} % of wall force and {row['tip_mm']:.2g} mm "
        f"{'in colons that move' if hung else 'in fixed ones'}"
        for hung, row in floor.items()
    )
    return _paragraph(
        f"Measured {machine['date']} on {machine['cores']} cores of {machine['processor']}, which other work shared "
        f"(load {machine['load']:.0f}), MuJoCo {machine['mujoco']}, Python {machine['python']}: {rows[0]['tracks']} "
        f"tracks a row, scripts of 10 s. The converged model has {_words(REFERENCE)}; one half as fine is {said} from "
        "it (medians), which is what errors here are good to."
    )


def _paragraph(text: str) -> str:
    return fill(text, 118, break_long_words=False, break_on_hyphens=False) + "\n\n"


def _words(setting: str) -> str:
    return ", ".join(part.replace("=", " ") for part in setting.split())


def _presets(rows: Sequence[Mapping[str, Any]]) -> str:
    found = {(row["setting"], row["mesentery"]): row for row in rows}
    lines = []
    for name, preset in PRESETS.items():
        changes = ", ".join(f"{key} {value}" for key, value in preset.in_linear_time.items())
        for hung in _KINDS:
            where = "mesentery" if hung else "fixed"
            lines.append([f"`{name}`", changes, where, *_numbers(found[name, hung])])
    head = ["preset", "against the table", "colon", "joints", "cost", *(name for name, _ in _QUANTITIES.values())]
    about = _paragraph(
        "`haustra run --preset NAME`, and `preset` among the options of a study of scopes. Against pieces and tangent "
        "planes presets have fewer joints, which are dear there ([errors](errors.md))."
    )
    return "## Presets\n\n" + about + _table(head, lines)


def _section(title: str, rows: Sequence[Mapping[str, Any]]) -> str:
    chosen = {row["setting"] for quantity in _QUANTITIES for row in best(rows, quantity)}
    kept = sorted((row for row in rows if row["setting"] in chosen and row["setting"] != COARSER), key=_cost)
    single = [row for row in rows if row["setting"] not in PRESETS and " " not in row["setting"]]
    head = ["setting", "joints", "cost", *(name for name, _ in _QUANTITIES.values())]
    text = f"\n## {title}\n\nWhat nothing beats in cost and one of the errors, of {len(rows)} ways of modelling:\n\n"
    text += _table(head, [[_said(row["setting"]), *_numbers(row)] for row in kept])
    text += "\n`balanced` with one number changed:\n\n"
    return text + _table(head, [[_said(row["setting"]), *_numbers(row)] for row in single])


def _cost(row: Mapping[str, Any]) -> float:
    return row["cost"]


def _said(setting: str) -> str:
    return f"`{setting}`" if setting in PRESETS else _words(setting)


def _numbers(row: Mapping[str, Any]) -> list[str]:
    errors = [
        f"{size * row[name]:.2g} ({size * row[f'{name}_most']:.2g}) {'%' if size > 1 else 'mm'}"
        for name, (_, size) in _QUANTITIES.items()
    ]
    return [str(row["dofs"]), f"{row['cost']:.2g}", *errors]


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines).replace("| --- |", "|---|").replace(" --- |", "---|")


_COLOURS = ("#b03a48", "#c9731b", "#a08000", "#4b8b4b", "#2f5d8a", "#8a5cb8")


def draw(path: Path, rows: Sequence[Mapping[str, Any]]) -> Path:
    """Error of push over cost, cells by colour: each line goes from long time steps to short ones."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained", sharey=True)
    cells = list(dict.fromkeys(each for row in rows if (each := _cells(row["setting"]))))
    cells.sort(reverse=True)
    for axis, (hung, title) in zip(axes, _KINDS.items(), strict=True):
        own = [row for row in rows if row["mesentery"] == hung]
        for colour, each in zip(_COLOURS, cells, strict=False):
            line = sorted(
                (row for row in own if _cells(row["setting"]) == each and "sample" not in row["setting"]), key=_cost
            )
            label = "cells of {} and {} mm".format(*(f"{1e3 * size:.3g}" for size in each))
            axis.loglog(
                [row["cost"] for row in line],
                [100 * row["push"] for row in line],
                "o-",
                color=colour,
                ms=4,
                label=label,
            )
        for row in own:
            if row["setting"] in PRESETS:
                axis.plot(row["cost"], 100 * row["push"], "D", color="#30343b", ms=7, mfc="none")
                axis.annotate(
                    row["setting"],
                    (row["cost"], 100 * row["push"]),
                    textcoords="offset points",
                    xytext=(7, 5),
                    fontsize=8,
                )
        axis.set_title(f"{title}", fontsize=10)
        axis.set_xlabel("processor time over simulated time of one scope", fontsize=9)
        axis.grid(alpha=0.25, which="both")
    axes[0].set_ylabel("error of the mean push, median [%]", fontsize=9)
    axes[1].legend(fontsize=7, frameon=False)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=110))
    plt.close(figure)
    return path


def _cells(setting: str) -> tuple[float, ...]:
    """Cells of shaft and bending section of a setting that names both."""
    named = dict(part.split("=") for part in setting.split() if "=" in part)
    return (
        tuple(float(named[name]) for name in ("shaft_cell", "bending_cell"))
        if {"shaft_cell", "bending_cell"} <= set(named)
        else ()
    )


if __name__ == "__main__":
    source, target, picture = map(Path, sys.argv[1:])
    measured = json.loads(source.read_text(encoding="utf-8"))
    page = front_page(measured)
    write_atomically(target, lambda temporary: temporary.write_text(page, encoding="utf-8"))
    draw(picture, measured["rows"])
