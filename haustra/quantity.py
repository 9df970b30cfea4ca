"""A physical number with its unit, range and source."""

import sys
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from haustra.errors import HaustraError

LARGEST = sys.float_info.max
"""Beyond it whole numbers cannot be compared with others as floats are."""


@dataclass(frozen=True)
class Quantity:
    """A number that can answer for itself."""

    value: float
    """In `unit`."""
    unit: str
    """SI, or an SI multiple named in full; '1' when dimensionless."""
    low: float
    """Lowest plausible value, in `unit`."""
    high: float
    """Highest plausible value, in `unit`."""
    source: str
    """DOI, citation, 'measured by ...', or 'engineering choice: why'."""
    note: str = ""
    """What a user should know before relying on it."""

    def __post_init__(self) -> None:
        if not self.unit or not self.source:
            raise HaustraError(f"Quantity {self.value} needs a unit and a source: add both to its TOML entry.")
        if not all(abs(number) <= LARGEST for number in (self.low, self.value, self.high)):
            raise HaustraError(f"Quantity in {self.unit} has a number that is not finite: check its TOML entry.")
        if not self.low <= self.value <= self.high:
            raise HaustraError(
                f"Quantity {self.value} {self.unit} is not inside [{self.low}, {self.high}]: check its TOML entry."
            )


def load_quantities(path: Path) -> dict[str, Quantity]:
    """Read a TOML file of tables into quantities, keyed by dotted name ('scope.adult.diameter').

    Raises:
        HaustraError: when an entry lacks a key, a unit or a source, or its value is outside its range.
    """
    return dict(_parsed(path.read_text(encoding="utf-8"), path.name))


@cache
def _parsed(text: str, where: str) -> dict[str, Quantity]:
    """Quantities of a file's text, which is parsed once: whoever builds many colons or scopes asks each time."""
    return dict(_flatten(tomllib.loads(text), where))


def _flatten(table: dict, where: str, prefix: str = ""):
    for key, entry in table.items():
        name = f"{prefix}{key}"
        if "value" not in entry:
            yield from _flatten(entry, where, f"{name}.")
            continue
        try:
            yield name, Quantity(**entry)
        except (TypeError, HaustraError) as error:
            raise HaustraError(f"{where}: '{name}': {error}") from error
