"""Values of declared fields for property-based tests: inside what a field declares, and outside."""

from collections.abc import Callable
from functools import cache, wraps
from typing import Any

from hypothesis import strategies as st

from haustra.fields import Choice, Declaration, Named, Number, Several, Span, Text, Truth, Vector

_Strategy = st.SearchStrategy[Any]


def _once(make: Callable[[Declaration], _Strategy]) -> Callable[[Declaration], _Strategy]:
    """Make a strategy once, whenever it is asked for: hypothesis checks each anew. Declarations need have no hash."""
    made: dict[int, tuple[Declaration, _Strategy]] = {}

    @wraps(make)
    def kept(declared: Declaration) -> _Strategy:
        if id(declared) not in made:
            made[id(declared)] = declared, make(declared)
        return made[id(declared)][1]

    return kept


@_once
def inside(declared: Declaration) -> _Strategy:
    """What a field declares, ends included, as a parsed file would give it."""
    match declared:
        case Number(_, low, high, True):
            return st.integers(int(low), int(high))
        case Number(_, low, high):
            return st.floats(low, high) | st.sampled_from([low, high])
        case Span(each):
            return st.lists(inside(each), min_size=2, max_size=2).map(sorted)
        case Several(each, least, most):
            return st.lists(inside(each or Text()), min_size=least, max_size=min(most, least + 3))
        case Vector(each):
            return st.tuples(*map(inside, each)).map(list)
        case Named(each, count):
            return st.lists(st.tuples(st.text("abc", max_size=3), *[inside(each)] * count).map(list), max_size=3)
        case Choice(words):
            return st.sampled_from(tuple(words))
        case Truth():
            return st.booleans()
    return st.text("abc ", max_size=20)


@_once
def outside(declared: Declaration) -> _Strategy:
    """What it does not: out of range, not finite, of another kind, too many, falling."""
    match declared:
        case Number(_, low, high, whole):
            kind = st.integers() if whole else st.floats() | st.integers()
            beyond = kind.filter(lambda value: not low <= value <= high)
            strange = st.sampled_from([float("nan"), float("inf"), -float("inf"), 10**400, 1e300, -1e300])
            return beyond | strange | _another_kind(str, bool, list, dict)
        case Span(each):
            falling = st.lists(inside(each), min_size=2, max_size=2, unique=True).map(lambda ends: sorted(ends)[::-1])
            return falling | st.lists(outside(each), min_size=2, max_size=2) | _another_kind(str, bool, float, dict)
        case Several(each, least, most):
            one = outside(each or Text())
            many = st.just([0] * (most + 1)) if most < 100 else st.nothing()
            none = st.just([]) if least else st.nothing()
            wrong = st.lists(one, min_size=max(least, 1), max_size=least + 2)
            return wrong | many | none | _another_kind(str, float, dict)
        case Vector(each):
            short = st.lists(inside(each[0]), max_size=len(each) - 1)
            return st.tuples(*map(outside, each)).map(list) | short | _another_kind(str, float, dict)
        case Named(each, count):
            return st.lists(st.tuples(st.just("a"), *[outside(each)] * count).map(list), min_size=1, max_size=2)
        case Choice(words):
            return st.text().filter(lambda text: text not in words) | _another_kind(float, bool, list, dict)
        case Truth():
            return _another_kind(str, float, int, list, dict)
    return st.text(min_size=1).filter(lambda text: not text.isprintable()) | _another_kind(float, bool, list, dict)


@cache
def _another_kind(*kinds: type) -> _Strategy:
    values = {str: st.text(), bool: st.booleans(), float: st.floats(), int: st.integers(), list: st.just([[1]])}
    return st.one_of(*(values.get(kind, st.just({"a": {"b": 1}})) for kind in kinds))
