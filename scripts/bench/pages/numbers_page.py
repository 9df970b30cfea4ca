"""Write the documentation page of sourced numbers.

`python -m haustra.scripts.bench.pages.numbers_page docs/numbers.md`.
"""

import sys
from itertools import groupby
from pathlib import Path

from haustra.assets import asset
from haustra.files import write_atomically
from haustra.quantity import Quantity, load_quantities

_HEAD = """\
# Numbers

Every physical number that haustra ships, with its unit, plausible range and source. This page is generated from
`assets/numbers/*.toml` by `make docs`; edit those files, not this page.

A source is a publication, "measured by …" or "engineering choice: why". *From memory, unverified* means that nobody has
checked the value against the document named: do so before you publish a result that depends on it.
"""


def numbers_page() -> str:
    """The page as Markdown, one table for each group of every TOML file."""
    parts = [_HEAD]
    for path in sorted(asset("numbers/scope.toml").parent.glob("*.toml")):
        for group, entries in groupby(load_quantities(path).items(), key=lambda entry: entry[0].rpartition(".")[0]):
            parts.append(_section(group or path.stem, {name.rpartition(".")[2]: value for name, value in entries}))
    return "\n".join(parts)


def _section(group: str, quantities: dict[str, Quantity]) -> str:
    title = group.replace(".", ", ").replace("_", " ")
    rows = "".join(
        f"| {name.replace('_', ' ')} | {_value(quantity)} | {_range(quantity)} | {_cell(_origin(quantity))} |\n"
        for name, quantity in quantities.items()
    )
    return f"## {title[0].upper()}{title[1:]}\n\n| number | value | range | source |\n|---|---|---|---|\n{rows}"


def _value(quantity: Quantity) -> str:
    return f"{quantity.value:g}" if quantity.unit == "1" else f"{quantity.value:g} {quantity.unit}"


def _range(quantity: Quantity) -> str:
    return f"{quantity.low:g} – {quantity.high:g}"


def _origin(quantity: Quantity) -> str:
    return f"{quantity.source}. *{quantity.note}*" if quantity.note else quantity.source


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


if __name__ == "__main__":
    page = numbers_page()
    write_atomically(Path(sys.argv[1]), lambda temporary: temporary.write_text(page, encoding="utf-8"))
