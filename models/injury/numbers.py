"""Numbers of injury, by name."""

from haustra.assets import asset
from haustra.quantity import load_quantities

INJURY = load_quantities(asset("numbers/injury.toml"))
"""Entries of assets/numbers/injury.toml, by their names there."""


def injury_number(name: str) -> float:
    """Value of a number of injury, by its name behind 'injury.'."""
    return float(INJURY[f"injury.{name}"].value)
