"""Declared fields: what is refused, and by which words."""

import math
from dataclasses import dataclass, field
from typing import Any, Literal

import pytest

from haustra.errors import InvalidDesignError, InvalidOptionError
from haustra.fields import (
    Number,
    choice,
    declared_fields,
    named,
    number,
    read_fields,
    require_declared,
    several,
    shown,
    span,
    texts,
    vector,
    whole,
)


@dataclass(frozen=True)
class Part:
    length: float = number("m", 0.01, 10.0, default=1.0)
    stiffness: float | None = number("N/m", 1.0, 1e6, default=None)


@dataclass(frozen=True)
class Whole:
    parts: tuple[Part, ...] = (Part(),)
    one: Part = field(default_factory=Part)
    count: int = whole(1, 10, default=2)
    ends: tuple[float, float] = span("1", 0.0, 1.0, default=(0.0, 1.0))
    times: tuple[float, ...] = several("s", 0.1, 9.0, default=(), most=2)
    gravity: tuple[float, float, float] = vector(*[Number("m/s^2", -100.0, 100.0)] * 3, default=(0.0, 0.0, 0.0))
    segments: tuple[tuple[str, float], ...] = named("N/m", 1.0, 1e6, default=())
    word: str = choice("a", "b", default="a")
    law: Literal["table", "planes"] = "table"
    fixed: bool = False
    title: str = "x"
    drivers: tuple[str, ...] = texts(least=1, default=("push",))

    def __post_init__(self) -> None:
        require_declared(self)


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"one": {"length": 1500}}, "one.length is 1500; give 0.01 to 10 m (is it in mm?)."),
    ({"one": {"length": math.nan}}, "one.length is nan; give 0.01 to 10 m."),
    ({"one": {"length": True}}, "one.length is True; give 0.01 to 10 m."),
    ({"one": {"length": "1"}}, "one.length is '1'; give 0.01 to 10 m."),
    ({"one": {"length": 10**400}}, "one.length is 1000000000000000000000000000...0000; give"),
    ({"one": {"stiffness": 0}}, "one.stiffness is 0; give 1 to 1e+06 N/m."),
    ({"one": 3}, "one is 3; give a table of values."),
    ({"one": {"lenght": 1}}, "'one.lenght' is not known. Known: length, stiffness."),
    ({"parts": [{}, {"length": -1}]}, "parts[1].length is -1; give 0.01 to 10 m."),
    ({"parts": {}}, "parts is {}; give a list of tables."),
    ({"count": 2.5}, "count is 2.5; give a whole number, 1 to 10."),
    ({"count": 11}, "count is 11; give a whole number, 1 to 10."),
    ({"ends": [0.5, 0.1]}, "ends is [0.5, 0.1]; give two rising numbers, 0 to 1."),
    ({"ends": [0, 2]}, "ends[1] is 2; give 0 to 1."),
    ({"ends": 1}, "ends is 1; give two rising numbers, 0 to 1."),
    ({"times": [1, 2, 3]}, "times is [1, 2, 3]; give 0 to 2 numbers, each 0.1 to 9 s."),
    ({"times": [1, math.inf]}, "times[1] is inf; give 0.1 to 9 s."),
    ({"gravity": [0, 0, 1e9]}, "gravity[2] is 1000000000.0; give -100 to 100 m/s^2."),
    ({"segments": [["sigmoid", -1]]}, "segments['sigmoid'] is -1; give 1 to 1e+06 N/m."),
    ({"word": "c"}, "word 'c' is not known. Known: a, b."),
    ({"word": ["a"]}, "word ['a'] is not known. Known: a, b."),
    ({"law": "field"}, "law 'field' is not known. Known: table, planes."),
    ({"fixed": 1}, "fixed is 1; give true or false."),
    ({"title": "two\nlines"}, "title is 'two\\nlines'; give text of up to 1000 characters in one line."),
    ({"drivers": []}, "drivers is []; give 1 to 10000 texts."),
]


@pytest.mark.parametrize(("values", "message"), REFUSED, ids=lambda value: str(value)[:40])
def test_it_is_refused_by_path_value_range_and_unit(values: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidOptionError) as refusal:
        read_fields(Whole, values)
    head, gap, tail = message.partition("...")
    assert str(refusal.value).startswith(head) and str(refusal.value).count("\n") == 0
    assert tail in str(refusal.value) or not gap


def test_keywords_are_checked_alike_and_the_error_is_of_its_kind() -> None:
    with pytest.raises(InvalidOptionError, match=r"^parts\[0\]\.length is 0"):
        Whole(parts=(Part(length=0),))
    with pytest.raises(InvalidDesignError, match=r"^mine\.toml: one\.length is 0"):
        read_fields(Whole, {"one": {"length": 0}}, "mine.toml", error=InvalidDesignError)
    with pytest.raises(InvalidOptionError, match=r"^--count is 0"):
        require_declared(_with_count(0), name=lambda name: f"--{name}")


def _with_count(count: int) -> Whole:
    made = Whole()
    object.__setattr__(made, "count", count)
    return made


def test_what_is_declared_is_taken_and_lists_become_tuples() -> None:
    found = read_fields(Whole, {"one": {"length": 2, "stiffness": None}, "ends": [0, 0], "parts": [], "times": [1]})
    assert found == Whole(one=Part(length=2), ends=(0, 0), parts=(), times=(1,))
    assert read_fields(Whole, {"one": Part(length=3)}).one.length == 3


def test_a_number_may_come_with_its_source_in_its_unit_only() -> None:
    sourced = {"value": 2, "unit": "m", "low": 1, "high": 3, "source": "measured"}
    assert read_fields(Whole, {"one": {"length": sourced}}).one.length == 2
    with pytest.raises(InvalidOptionError, match=r"one\.length is in 'mm'; give it in 'm'"):
        read_fields(Whole, {"one": {"length": sourced | {"unit": "mm"}}})
    with pytest.raises(InvalidOptionError, match=r"one\.length is 20"):
        read_fields(Whole, {"one": {"length": sourced | {"value": 20, "high": 30}}})


def test_every_field_is_listed_with_its_path() -> None:
    listed = {path: str(declared) for path, declared, _, _ in declared_fields(Whole)}
    assert listed["one.length"] == listed["parts[].length"] == "0.01 to 10 m"
    assert listed["fixed"] == "true or false" and len(listed) == 14


@pytest.mark.parametrize(
    "value",
    ["x" * 10**6, [[["x" * 9] * 99] * 99] * 99, {"a" * 99: "\x1b[2J"}, 10**5000],
    ids=["text", "lists", "table", "digits"],
)
def test_whatever_is_shown_is_short_and_moves_no_cursor(value: Any) -> None:
    assert len(shown(value)) < 400 and shown(value).isprintable()
