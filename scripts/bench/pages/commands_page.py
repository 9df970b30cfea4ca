"""The page of what came of running the documents' commands.

`python -m haustra.scripts.bench.pages.commands_page docs/validation/commands.md docs/validation/data/commands.json`.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from haustra.files import write_atomically
from haustra.scripts.bench.pages.commands_run import PAGES, printed

_HEAD = """\
# Commands as printed

**Claim.** Of the {count} commands and programs that {pages} print, {run} ran as printed, page by page
in an empty folder with a grown colon where the page expects one; {failed} failed, {left} left out. {missing}

    python -m haustra.scripts.bench.pages.commands_run DIR --data shared/data
    python -m haustra.scripts.bench.pages.commands_page docs/validation/commands.md DIR/commands.json

Run {dates} on two cores beside other work, at last of an {processor} (load {load:.0f}), so that times are far above
those of quiet cores. With docs/validation/data/commands.json put into DIR, the first command adds the pages that are
missing. That every command is understood by its parser, and that files of Python in docs/examples run, is tested at
every change.
"""


def commands_page(found: Mapping[str, Any]) -> str:
    """The page as Markdown.

    Args:
        found: `machine` and `rows`, as `commands_run` wrote them.
    """
    rows: Sequence[Mapping[str, Any]] = found["rows"]
    left = sum(row["code"] is None for row in rows)
    failed = sum(bool(row["code"]) for row in rows)
    numbers = {"count": len(rows), "run": len(rows) - left - failed, "failed": failed, "left": left}
    about = {key: found["machine"][key] for key in ("processor", "load")}
    pages, days = (sorted({row[key] for row in rows}) for key in ("page", "date"))
    missing = [
        each for page in PAGES for each in _missing(page, [row["what"] for row in rows if row["page"] == page.name])
    ]
    about |= {
        "pages": _listed(pages),
        "dates": f"on {days[0]}" if len(days) == 1 else f"from {days[0]} to {days[-1]}",
        "missing": f"Not tried as printed today: {_listed(missing)}." if missing else "Nothing else is printed there.",
    }
    parts = [_HEAD.format(**numbers, **about)]
    parts.append("## Run\n| page | command, or the program's last line | came to |\n|---|---|---|")
    parts += [f"| {row['page']} | {_code(row)} | {_came(row)} |" for row in rows if row["code"] is not None]
    parts.append("\n## Left out\n| why | commands, and programs by their last lines |\n|---|---|")
    why = sorted((row for row in rows if row["code"] is None), key=lambda row: row["said"])
    for said, own in groupby(why, key=lambda row: row["said"]):
        parts.append(f"| {said} | {'; '.join(dict.fromkeys(map(_code, own)))} |")
    return "\n".join([*parts, ""])


def _code(row: Mapping[str, Any]) -> str:
    return f"`{row['what'].replace('|', chr(92) + '|')}`"


def _missing(page: Path, tried: Sequence[str]) -> list[str]:
    """What a page prints today and was not tried: all of it, or commands by name."""
    said = [what for what in printed(page) if what not in tried]
    return [page.name] if said and not tried else [f"`{what}` ({page.name})" for what in said]


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def _came(row: Mapping[str, Any]) -> str:
    return f"{row['seconds']:.0f} s" if row["code"] == 0 else f"**failed** with code {row['code']}"


def main() -> None:
    """Write the page."""
    page, found = map(Path, sys.argv[1:])
    text = commands_page(json.loads(found.read_text(encoding="utf-8")))
    write_atomically(page, lambda place: place.write_text(text, encoding="utf-8"))


if __name__ == "__main__":
    main()
