"""Docstrings are full phrases that name their subject: a stranger reads them without the line above."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from haustra.scripts.bench.pages.fields_page import fields_page
from haustra.scripts.registry import VERBS

ROOT = Path(__file__).parents[1]
ROOMS = ("haustra", "assets", "models", "envs", "scripts", "tests", "docs")
RIDDLE = re.compile(r"(?:Of|The same|That)\b")
"""Beginnings that leave the subject to the line above: 'Of everything random' for 'Seed of all random draws'."""
LOOSE = re.compile(r"(?:About|Above|Along|As|At|Between|For|From|In|On|Once|Over|Then|Their|Whose)\b|\[|$")
"""Beginnings that help and the page of fields must not have either: 'In each colon', a unit alone, nothing."""


def _docstrings(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of every docstring, those below fields and constants included."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Expr(value=ast.Constant(value=str() as text)):
                yield node.lineno, text.strip()


def _riddles(source: str) -> list[tuple[int, str]]:
    return [(line, text.partition("\n")[0]) for line, text in _docstrings(source) if RIDDLE.match(text)]


@pytest.mark.parametrize("room", ROOMS)
def test_no_docstring_leaves_its_subject_to_the_line_above(room: str) -> None:
    # The trunk holds links to the other rooms, which are read by themselves.
    files = sorted((ROOT / room).glob("*.py") if room == "haustra" else (ROOT / room).rglob("*.py"))
    found = [
        f"{path.relative_to(ROOT).as_posix()}:{line}: {text}"
        for path in files
        for line, text in _riddles(path.read_text(encoding="utf-8"))
    ]
    assert files
    assert not found, "name the subject: not 'Of everything random' but 'Seed of all random draws'"


def _options(source: str) -> Iterator[tuple[str, str]]:
    """Name and help of every field of the classes of a verb's file; help is empty where there is none."""
    for body in (node.body for node in ast.parse(source).body if isinstance(node, ast.ClassDef)):
        for entry, after in zip(body, [*body[1:], None], strict=True):
            match entry, after:
                case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str() as text)):
                    yield name, text.strip()
                case ast.AnnAssign(target=ast.Name(id=name)), _:
                    yield name, ""


def test_help_names_the_subject_of_every_option() -> None:
    modules = {target.partition(":")[0].removeprefix("haustra.") for target in VERBS.values()}
    files = [ROOT / f"{module.replace('.', '/')}.py" for module in sorted(modules)]
    found = [
        f"{path.relative_to(ROOT).as_posix()}: --{name}: {text}"
        for path in files
        for name, text in _options(path.read_text(encoding="utf-8"))
        if LOOSE.match(text)
    ]
    assert files
    assert not found, "say what it is: not 'In each colon' but 'Number of episodes in each colon'"


def test_the_page_of_fields_names_the_subject_of_every_one() -> None:
    rows = [line.removeprefix("| ").removesuffix(" |") for line in fields_page().splitlines() if line.startswith("| ")]
    told = [(row.split(" | ")[0], row.rpartition(" | ")[2]) for row in rows if not row.startswith("field ")]
    assert told
    assert not [(name, text) for name, text in told if LOOSE.match(text)]


@pytest.mark.parametrize(
    "source",
    [
        '"""Of a module."""',
        'LENGTH = 0.1\n"""Of a link [m]."""',
        'class Part:\n    length: float\n    """\n    Of it [m]."""',
        'def part() -> None:\n    """That holds.\n\n    It is more.\n    """',
        'class Part:\n    def __init__(self) -> None:\n        self.length = 0.1\n        """The same."""',
    ],
)
def test_a_riddle_is_found_wherever_it_stands(source: str) -> None:
    assert len(_riddles(source)) == 1
    assert not _riddles(source.replace("Of", "Length of").replace("That", "What").replace("The same", "Length"))
    assert not _riddles("name = 'Of a colon'  # The same\n")
