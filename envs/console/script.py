"""Keys that are pressed by a script: what a hand does, at what simulated time."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from haustra.envs.console.session import Session
from haustra.errors import UnreadableFileError
from haustra.reading import read_document

_KNOWN = ("at", "hand", "change", "assist", "back")


def read_script(path: Path) -> list[dict[str, Any]]:
    """Entries of a JSON file, in the order of their times.

    Raises:
        UnreadableFileError: when it is no such list.
    """
    entries = read_document(path, "script of keys")
    sound = isinstance(entries, list) and all(
        isinstance(one, dict) and isinstance(one.get("at"), int | float) and not set(one) - set(_KNOWN)
        for one in entries
    )
    if not sound:
        raise UnreadableFileError(f"'{path}' is no script of keys: give a list of entries of {', '.join(_KNOWN)}.")
    return sorted(entries, key=lambda one: one["at"])


def obey(session: Session, waiting: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Do what is due, and say what is not yet; what was done is not done again after going back.

    Raises:
        InvalidOptionError: naming a lever or a condition that is not known.
    """
    left = list(waiting)
    while left and left[0]["at"] <= session.time + 1e-9:
        entry = left.pop(0)
        if "hand" in entry:
            session.hold(entry["hand"])
        for name, value in entry.get("change", {}).items():
            session.change(name, value)
        if "assist" in entry:
            session.assisted = bool(entry["assist"])
        if "back" in entry:
            session.back(float(entry["back"]))
    return left
