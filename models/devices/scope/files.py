"""Scope designs as TOML files: tables and keys are the fields of `ScopeDesign`, lengths in metres."""

from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from haustra.errors import InvalidDesignError
from haustra.fields import read_fields
from haustra.files import write_atomically
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.library import DESIGN_NAMES, named_design
from haustra.reading import read_document


def find_design(name: str) -> ScopeDesign:
    """A shipped design by its name, or one from a file whose name ends in .toml.

    Raises:
        InvalidDesignError: when there is no such design, or the file's values are impossible.
        UnreadableFileError: when the file cannot be read.
    """
    if name.endswith(".toml"):
        return load_design(Path(name))
    if name not in DESIGN_NAMES:
        raise InvalidDesignError(
            f"Design '{name}' is not known. Known: {', '.join(DESIGN_NAMES)}; or name a file that ends in .toml."
        )
    return named_design(name)


def load_design(path: Path) -> ScopeDesign:
    """Read a design from a TOML file.

    Raises:
        UnreadableFileError: when the file is missing or not TOML.
        InvalidDesignError: when a key is unknown or missing, a value is of the wrong kind, or parts do not fit.
    """
    return read_fields(ScopeDesign, read_document(path, "design"), path.name, error=InvalidDesignError)


def save_design(design: ScopeDesign, path: Path) -> Path:
    """Write a design as TOML; `load_design` gives it back.

    Raises:
        OutputError: when the file cannot be written.
    """
    text = design_text(design)
    return write_atomically(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def design_text(design: ScopeDesign) -> str:
    """The design as TOML text."""
    tables: list[str] = []
    lines = _lines(design)
    for entry in fields(design):
        value = getattr(design, entry.name)
        parts = value if isinstance(value, tuple) else (value,)
        for part in parts:
            if is_dataclass(part):
                head = f"[[{entry.name}]]" if isinstance(value, tuple) else f"[{entry.name}]"
                tables.append("\n".join([head, *_lines(part)]))
    return "\n\n".join(["\n".join(lines), *tables]) + "\n"


def _lines(part: Any) -> list[str]:
    lines = []
    for entry in fields(part):
        value = getattr(part, entry.name)
        if isinstance(value, str):
            escaped = value.replace("\\", "\\\\").replace('"', '\\"')
            lines.append(f'{entry.name} = "{escaped}"')
        elif isinstance(value, int | float):
            lines.append(f"{entry.name} = {value!r}")
    return lines
