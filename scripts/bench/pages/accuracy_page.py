"""Write the log of all that `haustra bench accuracy` measures, and its picture.

haustra bench accuracy -o DIR --rods RODS --colons COLON
python -m haustra.scripts.bench.pages.accuracy_page DIR/accuracy.json … docs/log/accuracy.md docs/images/accuracy.png

Of several files the first that holds a question counts.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from haustra.files import write_atomically
from haustra.models.presets import PRESETS

_LOG = """\
# Run time against error: all fronts and tables

What `haustra bench accuracy` measured in full. The front of cells, spheres and time steps in linear time, by which
presets are chosen, stands in [Run time against error](../validation/accuracy.md). A front holds the settings that no
other beats in both error and cost, cheapest first.

Costs are processor time, the median of all settings of a front taken in turn, so that ratios hold on a machine that
other work shares; a cost of 0.1 is ten times real time. *Speed* is simulated over processor time.

"""

_COLOURS = ("#2f5d8a", "#c9731b", "#4b8b4b", "#8a5cb8", "#b03a48", "#5a5a5a", "#1f9a9a", "#a08000")


def accuracy_log(result: Mapping[str, Any]) -> str:
    """Criteria, presets, all fronts and all tables as Markdown."""
    parts = [
        _LOG,
        _where(result["machine"]),
        _efforts(result.get("full", [])),
        "## Criteria\n\n",
        _criteria(result["criteria"]),
    ]
    parts += ["\n## Presets, one colon each\n\n", _presets(result), "\n![Fronts](../images/accuracy.png)\n"]
    parts += ["\n## How it was measured\n\n", *(f"* {line}\n" for line in result["summary"][1:]), "\n## Fronts\n\n"]
    parts += [_front(front) for front in result["fronts"]]
    parts += ["## Tables\n\n", *(_table(table) for table in result["tables"])]
    return "".join(parts).rstrip() + "\n"


def merged(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Several benchmarks as one: of each criterion, front and table, the first."""

    def first(kind: str, name: str) -> list[Any]:
        found: dict[str, Any] = {}
        for result in results:
            for each in result[kind]:
                found.setdefault(each[name], each)
        return list(found.values())

    return {
        "machine": results[0]["machine"],
        "full": [
            name
            for result in results
            if result["machine"].get("effort") == "full"
            for name in (
                *(each["question"] for each in result["fronts"]),
                *(each["title"] for each in result["tables"]),
            )
        ],
        "summary": list(dict.fromkeys(line for result in results for line in result["summary"])),
        "criteria": first("criteria", "what"),
        "fronts": first("fronts", "question"),
        "tables": first("tables", "title"),
    }


def _where(machine: Mapping[str, Any]) -> str:
    return (
        f"Measured {machine['date']} on {machine['cores']} cores of {machine['processor']} (load {machine['load']}), "
        f"MuJoCo {machine['mujoco']}, Python {machine['python']}.\n\n"
    )


def _efforts(full: Sequence[str]) -> str:
    named = f"At full effort: {'; '.join(full)}. All else" if full else "All"
    return f"{named} by `--quick`: coarser references and fewer settings than the command gives without it.\n\n"


def _criteria(criteria: Sequence[Mapping[str, Any]]) -> str:
    rows = [
        [
            criterion["what"],
            _number(criterion["measured"]),
            f"{criterion['sense']} {_number(criterion['bound'])}",
            criterion["unit"],
            _met(criterion),
        ]
        for criterion in criteria
    ]
    return _rows(["criterion", "full run", "bound", "unit", "verdict"], rows)


def _met(criterion: Mapping[str, Any]) -> str:
    return "met" if criterion["met"] else f"**{criterion.get('verdict', 'not met')}**"


def _presets(result: Mapping[str, Any]) -> str:
    rows = []
    for name, preset in PRESETS.items():
        changes = ", ".join(f"{key} {value}" for key, value in preset.changes.items()) or "the defaults"
        for colon, found in _insertions(result, f"preset={name}").items():
            cost = found["tip path"]["cost"]
            errors = [_number(found["tip path"]["error"]), *(_percent(found[w]["error"]) for w in _FORCES)]
            rows.append([f"`{name}`", changes, colon, *errors, f"{1 / cost:.3g}" if cost else "-"])
    header = ["preset", "changes", "colon", "tip, median [mm]", "mean push", "mean wall force", "speed"]
    return _rows(header, rows)


_FORCES = ("push force", "wall force")


def _insertions(result: Mapping[str, Any], setting: str) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for front in result["fronts"]:
        if not front["question"].startswith("insertion, "):
            continue
        colon, _, what = front["question"].removeprefix("insertion, ").rpartition(": ")
        for point in front["points"]:
            if point["setting"] == setting:
                found.setdefault(colon, {})[what] = point
    return found


def _front(front: Mapping[str, Any]) -> str:
    points = {point["setting"]: point for point in front["points"]}
    rows = [[name, _number(points[name]["error"]), _number(points[name]["cost"])] for name in front["best"]]
    lost = [f"{point['setting']} ({point['outcome']})" for point in front["points"] if point["outcome"] != "completed"]
    note = f"\nOf {len(points)} settings. " + (f"Not completed: {'; '.join(lost)}.\n" if lost else "All completed.\n")
    header = ["setting", front["error_unit"], front["cost_unit"]]
    return f"### {front['question']}\n\nAgainst {front['reference']}.\n\n{_rows(header, rows)}{note}\n"


def _table(table: Mapping[str, Any]) -> str:
    header = list(dict.fromkeys(name for row in table["rows"] for name in row))
    rows = [[_cell(row.get(name)) for name in header] for row in table["rows"]]
    note = f"\n{table['note']}\n" if table["note"] else ""
    return f"### {table['title']}\n\n{_rows([name.replace('_', ' ') for name in header], rows)}{note}\n"


def _rows(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(header)} |", f"|{'---|' * len(header)}"]
    lines += [f"| {' | '.join(each.replace('|', '/') for each in row)} |" for row in rows]
    return "\n".join(lines) + "\n"


def _cell(value: object) -> str:
    return _number(value) if isinstance(value, float) else "-" if value is None else str(value)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.2g} %"


def draw(path: Path, fronts: Sequence[Mapping[str, Any]]) -> Path:
    """Every front as a panel: error over cost, the best joined by a line."""
    import matplotlib.pyplot as plt

    columns = 3
    lines = -(-len(fronts) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(13, 3.6 * lines), layout="constrained", squeeze=False)
    for axis, front in zip(axes.flat, fronts, strict=False):
        _panel(axis, front)
    for axis in axes.flat[len(fronts) :]:
        axis.set_visible(False)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=80))
    plt.close(figure)
    return path


def _panel(axis: Any, front: Mapping[str, Any]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    drawn = [point for point in front["points"] if point["error"] and point["cost"]]
    groups = list(dict.fromkeys(point["group"] for point in drawn))
    for number, group in enumerate(groups):
        members = [point for point in drawn if point["group"] == group]
        colour, marker = _COLOURS[number % len(_COLOURS)], "os^"[number // len(_COLOURS) % 3]
        costs, errors = [p["cost"] for p in members], [p["error"] for p in members]
        axis.loglog(costs, errors, marker, color=colour, ms=5, label=group)
    best = [point for point in drawn if point["setting"] in front["best"]]
    best.sort(key=lambda point: point["cost"])
    axis.step([p["cost"] for p in best], [p["error"] for p in best], where="post", color="#30343b", lw=0.8)
    axis.set_title(front["question"], fontsize=9)
    axis.set_xlabel(front["cost_unit"], fontsize=8)
    axis.set_ylabel(front["error_unit"], fontsize=8)
    axis.tick_params(labelsize=7)
    axis.xaxis.set_major_locator(LogLocator(subs=(1, 3)))
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.yaxis.set_minor_formatter(NullFormatter())
    axis.grid(alpha=0.25)
    axis.legend(fontsize=6, frameon=False)


if __name__ == "__main__":
    *sources, log, picture = map(Path, sys.argv[1:])
    measured = merged([json.loads(source.read_text(encoding="utf-8")) for source in sources])
    page = accuracy_log(measured)
    write_atomically(log, lambda temporary: temporary.write_text(page, encoding="utf-8"))
    draw(picture, measured["fronts"])
