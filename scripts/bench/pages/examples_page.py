"""Pages of the example programs: each from its docstring, its picture and its source, and a gallery of all.

python -m haustra.scripts.bench.pages.examples_page docs/examples
"""

import ast
import sys
from pathlib import Path

from haustra.files import write_atomically

_PICTURES = (".webp", ".gif")
_HEAD = """# Examples

Short programs, each with what it draws. Every one runs as printed, and a test runs it in miniature.

| | program |
|---|---|
"""


def examples_pages(folder: Path) -> dict[str, str]:
    """Text of each page by the name of its file, for the programs of a folder."""
    programs = sorted(folder.glob("*.py"))
    rows = [_row(*_told(program), picture_of(program), program.stem) for program in programs]
    return {f"{program.stem}.md": _page(program) for program in programs} | {"index.md": _HEAD + "".join(rows)}


def picture_of(program: Path) -> str:
    """Name of the picture that lies beside a program."""
    return next(f"{program.stem}{suffix}" for suffix in _PICTURES if program.with_suffix(suffix).is_file())


def _told(program: Path) -> tuple[str, str, str]:
    """Title, what it is about, and more, from the docstring."""
    about = ast.get_docstring(ast.parse(program.read_text(encoding="utf-8"))) or ""
    first, _, more = about.partition("\n\n")
    title, _, rest = " ".join(first.split()).partition(": ")
    return title, rest[:1].upper() + rest[1:], " ".join(more.split())


def _row(title: str, about: str, more: str, picture: str, stem: str) -> str:
    return f"| [![{title}]({picture})]({stem}.md) | **[{title}]({stem}.md).** {about} |\n"


def _page(program: Path) -> str:
    title, about, more = _told(program)
    source = program.read_text(encoding="utf-8").partition('"""\n\n')[2]
    return (
        f"# {title}\n\n{about}\n\n{more}\n\n![{title}]({picture_of(program)})\n\n"
        f"    python docs/examples/{program.name}\n\n```python\n{source}```\n"
    )


if __name__ == "__main__":
    place = Path(sys.argv[1])
    for name, text in examples_pages(place).items():
        write_atomically(place / name, lambda path, text=text: path.write_text(text, encoding="utf-8"))
