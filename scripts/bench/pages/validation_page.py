"""Write the overview of validation from what `haustra bench` measured.

haustra bench -o bench
python -m haustra.scripts.bench.pages.validation_page bench/bench.json docs/validation.md
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

from haustra.envs.view.report.values import shown
from haustra.files import write_atomically
from haustra.scripts.bench.report import measured_and_bound, rows_table
from haustra.scripts.bench.result import Bench, bench_from_json

_HEAD = """\
# Validation

Made by `haustra/scripts/bench/pages/validation_page.py` from `haustra bench`; do not edit. What is not met is listed
with the rest. Bars were set beforehand, but for two tolerances of stability that were set after a first look: turned
frames (1 mm) and other units (1e-7). Pages below this one go deeper.
"""


def main(source: Path, target: Path) -> None:
    """Read bench.json, write a page of Markdown."""
    benches = [bench_from_json(values) for values in json.loads(source.read_text(encoding="utf-8"))["benches"]]
    page = "\n".join([_HEAD, *(line for bench in benches for line in _lines(bench))])
    write_atomically(target, lambda path: path.write_text(page + "\n", encoding="utf-8"))


def _lines(bench: Bench) -> Iterator[str]:
    yield f"## {bench.title}\n"
    yield from (paragraph + "\n" for paragraph in bench.summary)
    if bench.machine:
        yield ", ".join(f"{name} {shown(value)}" for name, value in bench.machine.items()) + ".\n"
    if bench.bars:
        yield "| bar | measured | bound | verdict |\n|---|---|---|---|"
        for bar in bench.bars:
            measured, bound = measured_and_bound(bar)
            yield f"| {bar.what} | {measured} | {bound} | {bar.verdict if bar.met else f'**{bar.verdict}**'} |"
        yield ""
    for front in bench.fronts:
        yield f"### {front.question}\n\nAgainst {front.reference}. The settings that nothing beats, cheapest first:\n"
        yield f"| setting | error [{front.error_unit}] | cost [{front.cost_unit}] |\n|---|---|---|"
        yield from (f"| {point.setting} | {point.error:.3g} | {point.cost:.3g} |" for point in front.best())
        yield ""
    for table in (rows_table(each) for each in bench.tables if each.rows):
        yield f"### {table.title}\n\n| {' | '.join(table.header)} |\n|{'---|' * len(table.header)}"
        yield from (f"| {' | '.join(row)} |" for row in table.rows)
        yield f"\n{table.note}" if table.note else ""


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
