"""Put figures into a page on stability: the largest steps into the page itself, criteria and shocks into the log.

python -m haustra.scripts.bench.pages.stability_page stability.json docs/validation/stability.md steps
python -m haustra.scripts.bench.pages.stability_page stability.json docs/log/stability.md criteria shocks

They stand between `<!-- NAME -->` and `<!-- /NAME -->`; the rest of the page is written by hand.
"""

import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from haustra.envs.view.report.values import shown
from haustra.files import write_atomically
from haustra.scripts.bench.report import measured_and_bound, rows_table
from haustra.scripts.bench.result import Bench, bench_from_json
from haustra.scripts.bench.stability.step import SHIPPED, TABLE
from haustra.scripts.bench.stability.step_scenes import INTEGRATORS


def with_figures(page: str, bench: Bench, only: Sequence[str] = ()) -> str:
    """The page with what the benchmark found; what has no table in it stays as it is."""
    tables = {table.title: table for table in bench.tables}
    blocks = {"criteria": "\n".join(_criteria(bench))}
    if TABLE in tables:
        blocks["steps"] = "\n".join(_steps(tables[TABLE].rows))
    if "Shocks" in tables:
        shocks = rows_table(tables["Shocks"])
        head = [f"| {' | '.join(shocks.header)} |", f"|{'---|' * len(shocks.header)}"]
        blocks["shocks"] = "\n".join([*head, *(f"| {' | '.join(row)} |" for row in shocks.rows)])
    for name in only or blocks:
        text = blocks[name]
        pattern = rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)"
        page = re.sub(pattern, lambda found, text=text: f"{found[1]}\n{text}\n\n{found[2]}", page, flags=re.DOTALL)
    return page


def _criteria(bench: Bench) -> Iterator[str]:
    yield f"{bench.summary[0]} {', '.join(f'{name} {shown(value)}' for name, value in bench.machine.items())}.\n"
    yield "| criterion | measured | bound | |\n|---|---|---|---|"
    for one in bench.criteria:
        measured, bound = measured_and_bound(one)
        yield f"| {one.what} | {measured} | {bound} | {one.verdict if one.met else f'**{one.verdict}**'} |"


def _steps(rows: tuple[Mapping[str, Any], ...]) -> Iterator[str]:
    """One line a scene and preset, one column an integrator."""
    found = {(row["scene"], row["preset"], row["integrator"]): row for row in rows}
    yield f"| scene | preset | its step | {' | '.join(INTEGRATORS)} | margin, {SHIPPED} |"
    yield f"|{'---|' * (len(INTEGRATORS) + 4)}"
    for scene, preset in dict.fromkeys((row["scene"], row["preset"]) for row in rows):
        each = [found.get((scene, preset, name)) for name in INTEGRATORS]
        shipped = found.get((scene, preset, SHIPPED))
        margin = "" if shipped is None else f"{_at_least(shipped)}{shipped['limit_over_preset']:.2g}"
        if shipped and shipped["margin"] != "kept":
            margin = f"**{margin}**"
        step = next(f"{row['preset_ms']:g} ms" for row in each if row)
        yield f"| {scene} | {preset} | {step} | {' | '.join(_limit(row) for row in each)} | {margin} |"


def _limit(row: Mapping[str, Any] | None) -> str:
    if row is None:
        return ""
    return f"{_at_least(row)}{row['limit_ms']:.2g} ms" if row["limit_ms"] else "none"


def _at_least(row: Mapping[str, Any]) -> str:
    return "≥ " if row["at_least"] else ""


if __name__ == "__main__":
    source, target = (Path(name) for name in sys.argv[1:3])
    found = bench_from_json(json.loads(source.read_text(encoding="utf-8")))
    text = with_figures(target.read_text(encoding="utf-8"), found, sys.argv[3:])
    write_atomically(target, lambda path: path.write_text(text, encoding="utf-8"))
