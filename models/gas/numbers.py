"""The sourced numbers of gas in the colon."""

from collections.abc import Mapping
from functools import cache

from haustra.assets import asset
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.gas.law import width_share
from haustra.quantity import load_quantities


@cache
def gas_numbers() -> Mapping[str, float]:
    """Values of assets/numbers/gas.toml, without their common prefix."""
    return {name.removeprefix("gas."): each.value for name, each in load_quantities(asset("numbers/gas.toml")).items()}


def diameter_share(xp, segment: str, pressure):
    """Diameter of a typical person's segment at a pressure [Pa], over that of CT colonography [1]."""
    known = gas_numbers()
    half, exponent = known[f"half_pressure.{segment}"], known["exponent"]
    return width_share(xp, pressure, full=known["full_pressure"], half=half, exponent=exponent)


@cache
def full_diameters() -> dict[str, float]:
    """Mean diameter of each segment at the set point of CT colonography [m]."""
    known = load_quantities(asset("numbers/anatomy.toml"))
    typical = known["anatomy.diameter.distension"].value
    return {name: typical * known[f"anatomy.diameter.{name}"].value for name in SEGMENTS}
