"""Drivers by name."""

from typing import Any

from haustra.envs.control.endoscopist import EndoscopistSettings
from haustra.envs.control.follower import FollowerSettings
from haustra.errors import InvalidOptionError

DRIVERS = {"follower": FollowerSettings, "endoscopist": EndoscopistSettings}
"""Types of settings of drivers that are laws (`haustra.envs.control.follower.Law`), by the drivers' names."""


def driver_settings(name: str, *, moves: bool, **changed: Any) -> Any:
    """Settings of a driver.

    Args:
        name: of `DRIVERS`.
        moves: whether the colon moves on its mesentery, so that there is something to straighten.
        changed: what differs from the usual.

    Raises:
        InvalidOptionError: when there is no such driver.
    """
    if name not in DRIVERS:
        raise InvalidOptionError(f"Driver '{name}' is not known. Known: {', '.join(DRIVERS)}.")
    return DRIVERS[name](straighten=moves, **changed)
