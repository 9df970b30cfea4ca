"""Physical numbers stand in assets/numbers with unit, range and source, and not in the code.

Numerical tolerances and engineering choices may stand beside what they serve where their docstring says so. What stood
there without saying so when this test was written is listed in `constants.txt`, which may only shrink.
"""

import ast
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FROZEN = Path(__file__).with_name("constants.txt")
UNIT = re.compile(r"\[(?!(?:1|pixels?|bytes?|turns?)\])[^\]\[\"']{1,20}\]")
"""A unit in a docstring; shares and counts are no physical numbers."""
CONSTANT = re.compile(r'^[A-Z_][^=\n]*= .*\n"""', re.MULTILINE)
"""Looks at a file for a constant with a docstring, which is cheaper than to parse it."""
EXCUSED = re.compile(r"engineering choice|tolerance", re.IGNORECASE)


def physical_constants(source: str) -> Iterator[str]:
    """Names of module constants that hold a literal number whose docstring names a unit and no excuse."""
    body = ast.parse(source).body
    for entry, after in pairwise(body):
        match entry, after:
            case ast.Assign(targets=[target], value=value), ast.Expr(value=ast.Constant(value=str() as text)):
                pass
            case ast.AnnAssign(target=target, value=value), ast.Expr(value=ast.Constant(value=str() as text)):
                pass
            case _:
                continue
        if value is not None and _holds_numbers(value) and UNIT.search(text) and not EXCUSED.search(text):
            yield ast.unparse(target).strip("()")


def _holds_numbers(value: ast.expr) -> bool:
    """Whether an expression is made of numbers alone: literals, their arithmetic, tuples and lists of them."""
    parts = (ast.Constant, ast.UnaryOp, ast.BinOp, ast.Tuple, ast.List, ast.operator, ast.unaryop, ast.expr_context)
    nodes = list(ast.walk(value))
    numbers = [node.value for node in nodes if isinstance(node, ast.Constant)]
    return (
        all(isinstance(node, parts) for node in nodes)
        and bool(numbers)
        and all(isinstance(number, int | float) and not isinstance(number, bool) for number in numbers)
    )


def _found() -> set[str]:
    rooms = {"haustra": "*.py"} | dict.fromkeys(("assets", "models", "envs"), "**/*.py")
    sources = {
        path: path.read_text(encoding="utf-8") for room, files in rooms.items() for path in (ROOT / room).glob(files)
    }
    return {
        f"{path.relative_to(ROOT).as_posix()} {name}"
        for path, source in sources.items()
        if CONSTANT.search(source)
        for name in physical_constants(source)
    }


def test_no_new_physical_number_stands_in_the_code() -> None:
    listed = FROZEN.read_text(encoding="utf-8").splitlines()
    found = _found()
    new = sorted(found - set(listed))
    assert not new, "put it into assets/numbers, or say in its docstring why it is an engineering choice or a tolerance"
    assert listed == sorted(found), "tests/assets/constants.txt may only shrink: take out what is gone, keep it sorted"


@pytest.mark.parametrize(
    "source",
    ['DENSITY = 1050.0\n"""Density of the wall [kg/m^3]."""', 'REACH: float = 2 * 0.1\n"""Reach of a hand [m]."""'],
)
def test_a_number_with_a_unit_is_seen(source: str) -> None:
    assert list(physical_constants(source)) == [source[: source.index(" ")].rstrip(":")]
    assert not list(physical_constants(source.replace("]", "]; engineering choice")))
    assert not list(physical_constants(re.sub(r"\[.*\]", "[1]", source)))


def test_what_is_read_from_the_numbers_is_left_alone() -> None:
    assert not list(physical_constants('SLIP = NUMBERS["contact.slip_speed"].value\n"""Slip speed [m/s]."""'))
