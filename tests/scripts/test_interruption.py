"""Ctrl-C that a library swallows ends the work all the same."""

import contextlib
import signal
import sys
from collections.abc import Iterator

import pytest

from haustra.scripts.console import progress_bar
from haustra.scripts.interruption import interruption_kept, raise_if_interrupted


@pytest.fixture(autouse=True)
def _heard() -> Iterator[None]:
    """Shells start what runs in the background with Ctrl-C ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def _swallowed() -> None:
    with contextlib.suppress(BaseException):  # as a destructor or a catch-all within a library does
        signal.raise_signal(signal.SIGINT)


def test_an_interruption_that_was_lost_is_raised_at_the_next_progress() -> None:
    with interruption_kept(), progress_bar("work", 2.0, unit="s") as show:
        show(1.0, "")
        _swallowed()
        with pytest.raises(KeyboardInterrupt):
            show(2.0, "")


class _Dies:
    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


def test_an_interruption_within_a_destructor_is_kept_and_leaves_no_traceback(monkeypatch) -> None:
    told = []
    monkeypatch.setattr(sys, "unraisablehook", told.append)
    with interruption_kept():
        _Dies()
        with pytest.raises(KeyboardInterrupt):
            raise_if_interrupted()
    assert not told


def test_one_call_inherits_no_interruption_of_the_call_before() -> None:
    before = signal.getsignal(signal.SIGINT)
    with interruption_kept():
        _swallowed()
    assert signal.getsignal(signal.SIGINT) is before
    with interruption_kept():
        raise_if_interrupted()
