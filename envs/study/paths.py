"""Changing one number deep inside a frozen design, by its path."""

from dataclasses import fields, is_dataclass, replace
from typing import TypeVar, get_type_hints

from haustra.errors import InvalidDesignError

T = TypeVar("T")


def with_values(part: T, changes: dict[str, float]) -> T:
    """A copy with the numbers at dotted paths replaced, all at once, so that parts that must fit together may change.

    Entries of a tuple are counted from 0; `*` is all of them.

    Raises:
        InvalidDesignError: when a path leads nowhere, or the changed design is impossible.
    """
    own: dict[str, dict[str, float]] = {}
    for path, value in changes.items():
        head, _, rest = path.partition(".")
        own.setdefault(head, {})[rest] = value
    if isinstance(part, tuple):
        return _with_entries(part, own)  # type: ignore[return-value]
    if not is_dataclass(part) or isinstance(part, type):
        raise InvalidDesignError(f"'{next(iter(changes))}' leads beyond a number: shorten the path.")
    known = [entry.name for entry in fields(part)]
    kinds = get_type_hints(type(part))
    new = {}
    for name, inner in own.items():
        if name not in known:
            raise InvalidDesignError(f"'{name}' is not known. Known: {', '.join(known)}.")
        new[name] = _changed(getattr(part, name), inner, name, whole=kinds[name] is int)
    return replace(part, **new)  # type: ignore[type-var]


def _with_entries(part: tuple, own: dict[str, dict[str, float]]) -> tuple:
    entries = list(part)
    for key, inner in own.items():
        if key != "*" and not (key.isdecimal() and len(key) < 19 and int(key) < len(entries)):
            raise InvalidDesignError(f"'{key}' is not one of 0 to {len(entries) - 1}, nor *.")
        for index in range(len(entries)) if key == "*" else [int(key)]:
            entries[index] = _changed(entries[index], inner, key, whole=False)
    return tuple(entries)


def _changed(value: object, inner: dict[str, float], name: str, *, whole: bool) -> object:
    if "" not in inner:
        return with_values(value, inner)
    new = inner[""]
    if isinstance(value, bool) or not isinstance(value, int | float | None):
        raise InvalidDesignError(f"'{name}' is not a number: lengthen the path.")
    if whole and not float(new).is_integer():
        raise InvalidDesignError(f"'{name}' counts something: {new:g} is not a whole number.")
    return int(new) if whole else float(new)
