"""Reading a table of a study's file key by key, so that whatever is wrong is named by its path."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from haustra.errors import InvalidStudyError
from haustra.fields import Text, declaration_of, read_fields, shown
from haustra.quantity import LARGEST

_ABSENT = object()


class TableReader:
    """One table; every key must be asked for, or `done` refuses it."""

    def __init__(self, table: Any, where: str, file: str):
        self._file, self._where = file, where
        if not isinstance(table, Mapping):
            raise self.wrong("", "expected a table of keys and values")
        self._table, self._known = table, list[str]()

    def wrong(self, key: str, complaint: str) -> InvalidStudyError:
        """The error that names a key of this table."""
        path = f"{self._where}.{shown(key)[1:-1]}".strip(".") or "the file"
        return InvalidStudyError(f"{self._file}: {path}: {complaint}.")

    def _take(self, key: str, default: Any) -> Any:
        self._known.append(key)
        if key in self._table:
            return self._table[key]
        if default is _ABSENT:
            raise self.wrong(key, "is missing: add it")
        return default

    def text(self, key: str, default: Any = _ABSENT, *, options: Sequence[str] = ()) -> str:
        """A text, one of `options` when there are any."""
        value = self._take(key, default)
        if value == "" or Text().wrong(value):
            raise self.wrong(key, f"expected text, found {shown(value)}")
        if options and value not in options:
            raise self.wrong(key, f"{shown(value)} is not known. Known: {', '.join(options)}")
        return value

    def number(self, key: str, default: Any = _ABSENT, *, least: float = -math.inf) -> float:
        """A finite number."""
        return float(self._number(key, self._take(key, default), least))

    def optional(self, key: str, *, least: float = -math.inf) -> float | None:
        """A finite number, or None where there is none."""
        value = self._take(key, None)
        return None if value is None else float(self._number(key, value, least))

    def declared(self, key: str, kind: type) -> Any:
        """What that field of a dataclass declares, or its default."""
        default = getattr(kind, key)
        value = self._take(key, default)
        if value is not default and (said := declaration_of(kind, key).wrong(value)):
            raise self.wrong(key, said.lstrip())
        return value

    def fields(self, key: str, kind: type) -> Any:
        """A dataclass of declared fields, from a table that may be missing."""
        try:
            return read_fields(kind, self._take(key, {}), error=InvalidStudyError)
        except InvalidStudyError as error:
            raise self.wrong(key, str(error).rstrip(".")) from error

    def numbers(self, key: str) -> tuple[float, ...]:
        """A list of different finite numbers, empty where there is none."""
        values = self._list(key, [])
        found = tuple(float(self._number(f"{key}[{index}]", value, -math.inf)) for index, value in enumerate(values))
        if len(set(found)) < len(found):
            raise self.wrong(key, "holds a value twice")
        return found

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts, empty where there is none."""
        values = self._list(key, [])
        for index, value in enumerate(values):
            if not isinstance(value, str):
                raise self.wrong(f"{key}[{index}]", f"expected text, found {shown(value)}")
        return tuple(values)

    def plain(self, key: str) -> dict[str, Any]:
        """A table of numbers, texts, truths and lists of them, empty where there is none."""
        table = self.table(key, {})
        for name, value in table._table.items():
            entries = value if isinstance(value, list) else [value]
            for index, entry in enumerate(entries):
                place = f"{key}.{name}[{index}]" if isinstance(value, list) else f"{key}.{name}"
                if not isinstance(entry, int | float | bool) and Text().wrong(entry):
                    raise self.wrong(place, f"expected a number or text, found {shown(entry)}")
                if isinstance(entry, int | float) and not abs(entry) <= LARGEST:
                    raise self.wrong(place, f"is {shown(entry)}; give a finite number")
        return dict(table._table)

    def table(self, key: str, default: Any = _ABSENT) -> "TableReader":
        """A table inside this one."""
        return TableReader(self._take(key, default), f"{self._where}.{key}".strip("."), self._file)

    def tables(self, key: str) -> list["TableReader"]:
        """A list of tables, empty where there is none."""
        where = f"{self._where}.{key}".strip(".")
        return [TableReader(entry, f"{where}[{index}]", self._file) for index, entry in enumerate(self._list(key, []))]

    def done(self) -> None:
        """Refuse keys that nobody asked for."""
        for key in self._table:
            if key not in self._known:
                raise self.wrong(str(key), f"is not known. Known: {', '.join(self._known)}")

    def _list(self, key: str, default: Any) -> list:
        value = self._take(key, default)
        if not isinstance(value, list):
            raise self.wrong(key, f"expected a list, found {shown(value)}")
        return value

    def _number(self, key: str, value: Any, least: float) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
            raise self.wrong(key, f"expected a finite number, found {shown(value)}")
        if value < least:
            raise self.wrong(key, f"is {shown(value)}; give at least {least:g}")
        return value
