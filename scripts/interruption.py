"""Ctrl-C that nothing can lose: Python drops it where it arrives within a destructor or a library's catch-all."""

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_asked = threading.Event()


@contextmanager
def interruption_kept() -> Iterator[None]:
    """Remember Ctrl-C beside raising it, for as long as this lasts; another's handler of SIGINT is left alone."""
    _asked.clear()
    mine = threading.current_thread() is threading.main_thread()
    if not mine or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    told = sys.unraisablehook
    signal.signal(signal.SIGINT, _remember_and_raise)

    def tell(lost: "sys.UnraisableHookArgs") -> None:
        if not issubclass(lost.exc_type, KeyboardInterrupt):  # which is remembered, and raised later
            told(lost)

    sys.unraisablehook = tell
    try:
        yield
    finally:
        sys.unraisablehook = told
        signal.signal(signal.SIGINT, signal.default_int_handler)
        _asked.clear()


def raise_if_interrupted() -> None:
    """Raise a Ctrl-C that came and was lost; long work asks this wherever it shows its progress.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed since `interruption_kept` began.
    """
    if _asked.is_set():
        raise KeyboardInterrupt


def _remember_and_raise(number: int, frame: FrameType | None) -> None:
    _asked.set()
    signal.default_int_handler(number, frame)
