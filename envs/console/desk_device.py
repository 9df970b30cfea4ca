"""A device on the desk beside the page: it is listened to in a thread of its own, and moves the hand of a drive."""

import threading
from abc import ABC, abstractmethod
from typing import TypeVar

from haustra.envs.console.source import Drive

Own = TypeVar("Own", bound="DeskDevice")


class DeskDevice(ABC):
    """Listens from `__enter__` on, and moves the hand before every control step."""

    def __init__(self, source: Drive, name: str) -> None:
        """Couple to a drive; the thread that listens has that name."""
        self._source, self._ends = source, threading.Event()
        self._thread = threading.Thread(target=self._listen, name=name, daemon=True)

    def __enter__(self: Own) -> Own:
        """Begin to listen."""
        self._source.before_step = self._move
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop listening."""
        self._ends.set()
        self._thread.join(timeout=2)
        self._source.before_step = None

    @abstractmethod
    def _move(self, interval: float) -> None:
        """Let the hand follow the device until the next control step [s]; in the thread of the drive."""

    @abstractmethod
    def _listen(self) -> None:
        """Hear the device until `_ends` is set."""
