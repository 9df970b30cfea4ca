"""Drivers by name, or from files of one's own."""

from pathlib import Path
from typing import Any

from haustra.envs.control.endoscopist import EndoscopistSettings
from haustra.envs.control.follower import FollowerSettings
from haustra.errors import InvalidOptionError
from haustra.fields import read_fields
from haustra.reading import read_document

DRIVERS = {"follower": FollowerSettings, "endoscopist": EndoscopistSettings}
"""Types of settings of drivers that are laws (`haustra.envs.control.follower.Law`), by the drivers' names."""


def driver_settings(name: str, *, moves: bool, **changed: Any) -> Any:
    """Settings of a driver.

    Args:
        name: of `DRIVERS`, or a TOML file with `law`, one of these names, and the settings that differ from the usual.
        moves: whether the colon moves on its mesentery, so that there is something to straighten.
        changed: what differs from the usual, and from the file.

    Raises:
        InvalidOptionError: when there is no such driver, or the file's settings are unknown or out of range.
        UnreadableFileError: when the file cannot be read.
    """
    if not name.endswith(".toml"):
        return _kind(name)(straighten=moves, **changed)
    own = read_document(Path(name), "driver")
    kind = _kind(str(own.pop("law", "")), f"{Path(name).name}: law ")
    own["straighten"] = moves and own.get("straighten", True)
    return read_fields(kind, own | changed, Path(name).name)


def _kind(name: str, where: str = "Driver ") -> Any:
    if name not in DRIVERS:
        raise InvalidOptionError(f"{where}'{name}' is not known. Known: {', '.join(DRIVERS)}; or name a TOML file.")
    return DRIVERS[name]
