"""The numbers of insufflation: pressures, and how wide each segment is when full."""

from dataclasses import dataclass
from functools import cache

from haustra.assets import asset
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.quantity import load_quantities


@dataclass(frozen=True)
class Pressures:
    """What opens a colon; pressures in [Pa]."""

    full: float
    """At it segments have the diameters of CT colonography."""
    opening: float
    """At it 63 % of the diameter is reached."""
    highest: float
    """More is refused."""
    ball_share: float
    """Largest ball over the diameter of equal volume [1]."""


@cache
def pressures() -> Pressures:
    """Sourced pressures."""
    numbers = load_quantities(asset("numbers/insufflation.toml"))
    names = ("full_pressure", "opening_pressure", "pain_pressure", "ball_share")
    return Pressures(*(numbers[f"insufflation.{name}"].value for name in names))


@cache
def full_diameters() -> dict[str, float]:
    """Mean diameter of each segment in insufflated colons [m]."""
    numbers = load_quantities(asset("numbers/anatomy.toml"))
    return {name: numbers[f"anatomy.diameter.{name}"].value for name in SEGMENTS}
