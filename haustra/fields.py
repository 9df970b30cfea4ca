"""Fields of frozen dataclasses that declare what they may hold: the one check of every configuration.

`number`, `whole`, `span`, `several`, `vector`, `choice` and `one_of` make fields with a unit and a range; words of a
`Literal`, texts and truths declare themselves by their type. A class calls `require_declared` in `__post_init__`, so
that TOML, JSON, keywords and options of the command line are checked alike; `read_fields` makes one from a parsed file.
Messages name path, value, range and unit. `declared_fields` lists them for docs/reference/fields.md.
"""

import math
import types
import typing
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from functools import cache
from numbers import Integral, Real
from reprlib import Repr
from typing import Any, Literal

from haustra.errors import HaustraError, InvalidOptionError
from haustra.quantity import Quantity

_SMALLER: Mapping[str, tuple[tuple[float, str], ...]] = {
    "m": ((1e-3, "mm"), (1e-2, "cm")),
    "s": ((1e-3, "ms"),),
    "kg": ((1e-3, "g"),),
    "kg/m": ((1e-3, "g/m"),),
    "N m^2": ((1e-6, "N mm^2"), (1e-4, "N cm^2")),
    "N/m": ((1e3, "N/mm"),),
    "m/s": ((1e-3, "mm/s"),),
}
"""Units that people take by mistake, and how many of the right ones they are."""
_SHORT = Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60
_SHORT.maxlevel, _SHORT.maxdict, _SHORT.maxlist, _SHORT.maxtuple = 2, 3, 4, 4
_QUANTITY = {entry.name for entry in fields(Quantity)}
_KEY = "declared"


class Declaration(ABC):
    """What a field may hold."""

    @abstractmethod
    def wrong(self, value: Any) -> str | None:
        """What is wrong with a value, to be said behind the field's path; None when nothing is."""

    @abstractmethod
    def __str__(self) -> str:
        """What to give instead, such as '0.001 to 10 m'."""

    @property
    def unit(self) -> str | None:
        """Unit of its numbers, where it has one."""
        return None


@dataclass(frozen=True)
class Number(Declaration):
    """A number from `low` to `high`, both included."""

    of: str
    """Its unit; '1' when dimensionless."""
    low: float
    high: float
    whole: bool = False

    @property
    def unit(self) -> str:
        """Unit of the number."""
        return self.of

    def __str__(self) -> str:
        unit = "" if self.of == "1" else f" {self.of}"
        ends = (f"{end:,.0f}".replace(",", "") if self.whole else f"{end:g}" for end in (self.low, self.high))
        return f"{'a whole number, ' if self.whole else ''}{' to '.join(ends)}{unit}"

    def wrong(self, value: Any) -> str | None:
        """Whether it is no such number, or out of range; names the unit that it is probably in."""
        if isinstance(value, bool) or not isinstance(value, Integral if self.whole else Real):
            return f" is {shown(value)}; give {self}"
        number = typing.cast(float, value)
        if self.low <= number <= self.high:
            return None
        likely = [name for size, name in _SMALLER.get(self.of, ()) if _between(self.low, number, self.high, size)]
        return f" is {shown(value)}; give {self}" + (f" (is it in {likely[0]}?)" if likely else "")


@dataclass(frozen=True)
class Span(Declaration):
    """Two numbers, the second no less than the first."""

    each: Number

    @property
    def unit(self) -> str:
        """Unit of both."""
        return self.each.of

    def __str__(self) -> str:
        return f"two rising numbers, {str(self.each).removeprefix('a whole number, ')}"

    def wrong(self, value: Any) -> str | None:
        """Whether there are not two, one is out of range, or they fall."""
        if not _is_list(value) or len(value) != 2:
            return f" is {shown(value)}; give {self}"
        return _first_wrong([self.each] * 2, value) or (
            f" is {shown(value)}; give {self}" if value[0] > value[1] else None
        )


@dataclass(frozen=True)
class Several(Declaration):
    """Some numbers, or texts."""

    each: Number | None
    least: int
    most: int

    @property
    def unit(self) -> str | None:
        """Unit of each."""
        return self.each.of if self.each else None

    def __str__(self) -> str:
        return f"{self.least} to {self.most} {'texts' if self.each is None else f'numbers, each {self.each}'}"

    def wrong(self, value: Any) -> str | None:
        """Whether there are too few or too many, or one of them is wrong."""
        if not _is_list(value) or not self.least <= len(value) <= self.most:
            return f" is {shown(value)}; give {self}"
        return _first_wrong([self.each or Text()] * len(value), value)


@dataclass(frozen=True)
class Vector(Declaration):
    """As many numbers as declared, each with a range of its own."""

    each: tuple[Number, ...]

    @property
    def unit(self) -> str:
        """Units of its numbers."""
        return ", ".join(dict.fromkeys(one.of for one in self.each))

    def __str__(self) -> str:
        return f"{len(self.each)} numbers: {', '.join(map(str, dict.fromkeys(self.each)))}"

    def wrong(self, value: Any) -> str | None:
        """Whether there are not as many, or one of them is wrong."""
        if not _is_list(value) or len(value) != len(self.each):
            return f" is {shown(value)}; give {self}"
        return _first_wrong(self.each, value)


@dataclass(frozen=True)
class Named(Declaration):
    """Entries of a name and one or more numbers."""

    each: Number
    count: int = 1
    """Numbers behind each name."""

    @property
    def unit(self) -> str:
        """Unit of each number."""
        return self.each.of

    def __str__(self) -> str:
        return f"entries of a name and {'a number' if self.count == 1 else f'{self.count} numbers'}, each {self.each}"

    def wrong(self, value: Any) -> str | None:
        """Whether an entry is not a name and such numbers."""
        length, entries = 1 + self.count, value if _is_list(value) else [None]
        if not all(_is_list(one) and len(one) == length and isinstance(one[0], str) for one in entries):
            return f" is {shown(value)}; give {self}"
        found = ((name, self.each.wrong(number)) for name, *numbers in value for number in numbers)
        return next((f"[{shown(name)}]{said}" for name, said in found if said), None)


@dataclass(frozen=True)
class Choice(Declaration):
    """One of some words: of those that are known when it is asked."""

    words: Collection[Any]

    def __str__(self) -> str:
        return ", ".join(map(str, self.words))

    def wrong(self, value: Any) -> str | None:
        """Whether it is none of them."""
        fine = any(type(value) is type(word) and value == word for word in self.words)
        return None if fine else f" {shown(value)} is not known. Known: {self}"


@dataclass(frozen=True)
class Text(Declaration):
    """A text of one line."""

    def __str__(self) -> str:
        return "text of up to 1000 characters in one line"

    def wrong(self, value: Any) -> str | None:
        """Whether it is no text, too long, or holds what no line does."""
        fine = isinstance(value, str) and len(value) <= 1000 and all(map(str.isprintable, value))
        return None if fine else f" is {shown(value)}; give {self}"


@dataclass(frozen=True)
class Truth(Declaration):
    """True or false."""

    def __str__(self) -> str:
        return "true or false"

    def wrong(self, value: Any) -> str | None:
        """Whether it is neither."""
        return None if isinstance(value, bool) else f" is {shown(value)}; give {self}"


def number(unit: str, low: float, high: float, *, default: Any = MISSING) -> Any:
    """A field that holds a number in that unit and range, or None where its type allows that."""
    return _declared(Number(unit, low, high), default)


def whole(low: int, high: int, *, default: Any = MISSING) -> Any:
    """A field that holds a whole number in that range."""
    return _declared(Number("1", low, high, whole=True), default)


def span(unit: str, low: float, high: float, *, default: Any = MISSING, whole: bool = False) -> Any:
    """A field that holds two rising numbers in that unit and range."""
    return _declared(Span(Number(unit, low, high, whole)), default)


def several(
    unit: str, low: float, high: float, *, default: Any = MISSING, least: int = 0, most: int = 1000, whole: bool = False
) -> Any:
    """A field that holds `least` to `most` numbers in that unit and range."""
    return _declared(Several(Number(unit, low, high, whole), least, most), default)


def texts(*, least: int = 0, most: int = 10_000, default: Any = MISSING) -> Any:
    """A field that holds `least` to `most` texts."""
    return _declared(Several(None, least, most), default)


def vector(*each: Number, default: Any = MISSING) -> Any:
    """A field that holds as many numbers, each declared."""
    return _declared(Vector(each), default)


def named(unit: str, low: float, high: float, *, default: Any = MISSING, count: int = 1) -> Any:
    """A field that holds entries of a name and `count` numbers in that unit and range."""
    return _declared(Named(Number(unit, low, high), count), default)


def choice(*words: str, default: Any = MISSING) -> Any:
    """A field that holds one of some words; a `Literal` type declares the same."""
    return _declared(Choice(words), default)


def one_of(known: Mapping[str, Any], *, default: Any = MISSING) -> Any:
    """A field that holds a name of what a registry knows, also of what is entered there later."""
    return _declared(Choice(known), default)


def require_declared(
    config: Any,
    where: str = "",
    *,
    error: type[HaustraError] = InvalidOptionError,
    name: Callable[[str], str] = str,
) -> None:
    """Refuse what a configuration's fields do not declare, its parts' included.

    Args:
        config: an instance of a dataclass.
        where: what it is, said before the path.
        error: what to raise.
        name: how a field is called.

    Raises:
        HaustraError: of the kind `error`; names path, value, range and unit.
    """
    for path, said in _complaints(config, "", name):
        raise error(f"{where}{': ' if where else ''}{path}{said}.")


def read_fields(kind: type, table: Any, where: str = "", *, error: type[HaustraError] = InvalidOptionError) -> Any:
    """A dataclass from a parsed TOML or JSON table; its numbers may come with unit, range and source, as a `Quantity`.

    Raises:
        HaustraError: of the kind `error`, when a key is unknown or missing, or a value is not what its field declares.
    """
    try:
        return _read(kind, table, "")
    except _WrongError as wrong:
        raise error(f"{where}{': ' if where else ''}{wrong}.") from wrong


def declaration_of(kind: type, name: str) -> Declaration:
    """What a field of a dataclass may hold.

    Raises:
        KeyError: when there is no such field, or it declares nothing.
    """
    entry = next((entry for entry in fields(kind) if entry.name == name), None)
    found = _declaration(entry, _hints(kind)[name]) if entry else None
    if found is None:
        raise KeyError(f"{kind.__name__} declares no field '{name}'")
    return found


def declared_fields(kind: type, path: str = "") -> Iterator[tuple[str, Declaration, Any, type]]:
    """Path, declaration, default and the class that holds it, of every declared field of a dataclass and its parts."""
    hints = _hints(kind)
    for entry in fields(kind):
        hint, place = hints[entry.name], f"{path}{entry.name}"
        part = _part(hint)
        if declared := _declaration(entry, hint):
            yield place, declared, entry.default, kind
        elif part is not None:
            yield from declared_fields(part, f"{place}{'[]' if typing.get_origin(hint) is tuple else ''}.")


def shown(value: Any) -> str:
    """A value in few characters of one line, whatever it is."""
    if isinstance(value, float):
        return repr(float(value))
    try:
        return "".join(letter if letter.isprintable() else "?" for letter in _SHORT.repr(value))
    except ValueError:  # of a whole number with more digits than Python prints
        return "a number of too many digits"


class _WrongError(Exception):
    """What is wrong with a parsed table, path first."""


def _declared(what: Declaration, default: Any) -> Any:
    if isinstance(default, list | dict | set):
        raise TypeError("A field's default is shared: give a tuple.")
    return field(default=default, metadata={_KEY: what})


def _between(low: float, value: float, high: float, size: float) -> bool:
    """Whether a value is in range when it is in units of that size; a number too large for a float is not."""
    try:
        return math.isfinite(value) and value != 0 and low <= value * size <= high
    except OverflowError:
        return False


def _is_list(value: Any) -> typing.TypeGuard[Sequence[Any]]:
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def _first_wrong(each: Sequence[Declaration], values: Sequence[Any]) -> str | None:
    found = ((index, one.wrong(value)) for index, (one, value) in enumerate(zip(each, values, strict=True)))
    return next((f"[{index}]{said}" for index, said in found if said), None)


@cache
def _hints(kind: type) -> Mapping[str, Any]:
    """Types of a class's fields; of an optional one, the type besides None."""
    return {name: _without_none(hint)[0] for name, hint in typing.get_type_hints(kind).items()}


@cache
def _optional(kind: type) -> frozenset[str]:
    """Names of the fields that may be None."""
    return frozenset(name for name, hint in typing.get_type_hints(kind).items() if _without_none(hint)[1])


def _without_none(hint: Any) -> tuple[Any, bool]:
    if not isinstance(hint, types.UnionType) and typing.get_origin(hint) is not typing.Union:
        return hint, False
    options = [option for option in typing.get_args(hint) if option is not type(None)]
    return (options[0] if len(options) == 1 else Any), type(None) in typing.get_args(hint)


def _part(hint: Any) -> type | None:
    """The dataclass that a field holds, or holds some of."""
    inner = typing.get_args(hint)[0] if typing.get_origin(hint) is tuple else hint
    return inner if isinstance(inner, type) and is_dataclass(inner) else None


def _declaration(entry: Any, hint: Any) -> Declaration | None:
    if _KEY in entry.metadata:
        return entry.metadata[_KEY]
    if typing.get_origin(hint) is Literal:
        return Choice(typing.get_args(hint))
    return {bool: Truth(), str: Text()}.get(hint) if isinstance(hint, type) else None


def _complaints(config: Any, path: str, name: Callable[[str], str]) -> Iterator[tuple[str, str]]:
    kind = type(config)
    for entry in fields(config):
        value, hint, place = getattr(config, entry.name), _hints(kind)[entry.name], f"{path}{name(entry.name)}"
        if value is None and entry.name in _optional(kind):
            continue
        part = _part(hint)
        if declared := _declaration(entry, hint):
            if said := declared.wrong(value):
                yield place, said
        elif part is not None and typing.get_origin(hint) is tuple:
            if not _is_list(value) or not all(isinstance(one, part) for one in value):
                yield place, f" is {shown(value)}; give a list of tables"
                continue
            for index, one in enumerate(value):
                yield from _complaints(one, f"{place}[{index}].", name)
        elif part is not None:
            if isinstance(value, part):
                yield from _complaints(value, f"{place}.", name)
            else:
                yield place, f" is {shown(value)}; give a table"


def _read(kind: type, table: Any, path: str) -> Any:
    if isinstance(table, kind):
        return table
    if not isinstance(table, Mapping):
        raise _WrongError(f"{path.rstrip('.') or 'it'} is {shown(table)}; give a table of values")
    known = {entry.name: entry for entry in fields(kind)}
    for key in table:
        if key not in known:
            raise _WrongError(f"'{path}{shown(key)[1:-1]}' is not known. Known: {', '.join(known)}")
    for key, entry in known.items():
        if key not in table and entry.default is MISSING and entry.default_factory is MISSING:
            raise _WrongError(f"'{path}{key}' is missing: add it")
    hints, optional = _hints(kind), _optional(kind)
    values = {
        key: None if value is None and key in optional else _value(known[key], hints[key], value, f"{path}{key}")
        for key, value in table.items()
    }
    try:
        return kind(**values)
    except HaustraError as error:
        raise _WrongError(f"{path.rstrip('.')}{': ' if path else ''}{str(error).rstrip('.')}") from error


def _value(entry: Any, hint: Any, value: Any, path: str) -> Any:
    """A value as its field wants it."""
    part, declared = _part(hint), _declaration(entry, hint)
    if declared is None and part is not None:
        if typing.get_origin(hint) is not tuple:
            return _read(part, value, f"{path}.")
        if not _is_list(value):
            raise _WrongError(f"{path} is {shown(value)}; give a list of tables")
        return tuple(_read(part, one, f"{path}[{index}].") for index, one in enumerate(value))
    if isinstance(declared, Number) and isinstance(value, Mapping) and value and set(value) <= _QUANTITY:
        value = _sourced(value, path, declared.of)
    if declared is not None and (said := declared.wrong(value)):
        raise _WrongError(f"{path}{said}")
    if _is_list(value):
        return tuple(tuple(one) if _is_list(one) else one for one in value)
    return float(typing.cast(float, value)) if hint is float else value


def _sourced(table: Mapping[str, Any], path: str, unit: str) -> Any:
    try:
        quantity = Quantity(**table)
    except (TypeError, HaustraError) as error:
        raise _WrongError(f"{path}: {str(error).rstrip('.')}") from error
    if quantity.unit != unit:
        raise _WrongError(f"{path} is in {shown(quantity.unit)}; give it in '{unit}'")
    return quantity.value
