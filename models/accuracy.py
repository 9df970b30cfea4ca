"""How far a run's answers are off by numerics alone: ranges that were measured over many colons, never one value.

`haustra bench errors` drives one script of hand and wires through every way of modelling and through a converged one,
in at least ten colons, and writes assets/accuracy.toml.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal

from haustra.assets import asset
from haustra.errors import HaustraError
from haustra.models.anatomy.colon import Colon
from haustra.models.presets import preset_of
from haustra.models.scene import SceneOptions
from haustra.models.wall.elasticity import LINEAR

LEAST_COLONS = 10
"""A range over fewer colons is not stated: single colons differ by a factor of ten."""

KINDS = ("grown", "real")
"""Kinds of colon that errors are told apart by; a range of real ones spans grown ones too, since few are public."""

QUANTITIES = ("wall_force", "push", "tip_mm")
"""What errors are stated of: relative errors of the mean sum of wall forces and of the mean push, and the median
distance of the tip from that of a converged run [mm]."""

Range = tuple[float | None, float | None]


@dataclass(frozen=True)
class NumericalError:
    """Lowest and highest error of each quantity; None where nothing was measured."""

    wall_force: Range = (None, None)
    """Relative, of the mean sum of wall forces [1]."""
    push: Range = (None, None)
    """Relative, of the mean push [1]."""
    tip_mm: Range = (None, None)
    """Median distance of the tip from the path of the reference [mm]."""
    measured_on: str = "not measured"
    """Colons, devices, reference and command; or that nothing was measured."""
    differences: Mapping[str, Mapping[str, float | None]] = field(default_factory=dict)
    """Differences of every score from each repeat of the run itself, where there were any, by score and repeat."""

    def to_json(self) -> dict[str, Any]:
        """As plain JSON values."""
        ranges = {name: list(getattr(self, name)) for name in QUANTITIES}
        own = {"differences": {name: dict(each) for name, each in self.differences.items()}} if self.differences else {}
        return {**ranges, "measured_on": self.measured_on, **own}


NOT_MEASURED = NumericalError()


@dataclass(frozen=True)
class Measured:
    """An entry of assets/accuracy.toml: ranges for one way of modelling, over colons of one kind."""

    wall_law: str
    wall: str
    """How pieces were made; none for the other laws."""
    mesentery: bool
    preset: str
    colon: Literal["grown", "real"]
    colons: int
    """How many colons the ranges span."""
    error: NumericalError


def stated_error(options: SceneOptions, colon: str, *, wall: str | None = None) -> NumericalError:
    """What was measured for scenes with those options; `NOT_MEASURED` where that is nothing.

    Args:
        options: of the scene.
        colon: kind of colon, of `KINDS`.
        wall: how the pieces of the wall were made; None for laws without pieces.
    """
    if options.elasticity != LINEAR or options.friction_rise:
        return NOT_MEASURED
    pieces = (wall or "") if options.wall_law == "pieces" else ""
    asked = (options.wall_law, pieces, options.mesentery, preset_of(options), colon)
    for entry in measured():
        if (entry.wall_law, entry.wall, entry.mesentery, entry.preset, entry.colon) == asked:
            return entry.error
    return NOT_MEASURED


def kind_of(colon: Colon) -> str:
    """Kind of a colon, of `KINDS`: grown from a recipe, or imported."""
    return "grown" if dict(colon.provenance.configuration).get("method") == "grown" else "real"


def load_measured(path: Path) -> tuple[Measured, ...]:
    """Read measured errors.

    Raises:
        HaustraError: when an entry lacks a key or a source, spans too few colons, or has an impossible range.
    """
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    return tuple(_entry(entry, path.name) for entry in table.get("measured", ()))


def _entry(values: Mapping[str, Any], where: str) -> Measured:
    try:
        ranges = {name: (float(values[name][0]), float(values[name][1])) for name in QUANTITIES}
        found = Measured(
            **{name: values[name] for name in ("wall_law", "wall", "mesentery", "preset", "colon", "colons")},
            error=NumericalError(*(ranges[name] for name in QUANTITIES), measured_on=values["source"]),
        )
    except (KeyError, IndexError, TypeError) as error:
        raise HaustraError(f"{where}: an entry lacks {error}: measure again (`haustra bench errors`).") from error
    possible = all(0 <= low <= high < float("inf") for low, high in ranges.values())
    if not possible or not found.error.measured_on or found.colon not in KINDS or found.colons < LEAST_COLONS:
        raise HaustraError(
            f"{where}: entries need ranges from low to high, a source and at least {LEAST_COLONS} colons: {values}."
        )
    return found


@cache
def measured() -> tuple[Measured, ...]:
    """Every entry of assets/accuracy.toml."""
    return load_measured(asset("accuracy.toml"))
