"""Batches that a device's memory does not hold are answered in halves."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from haustra.envs.study.study import Result

One = TypeVar("One")


def halved(
    answer: Callable[[Sequence[One]], list[Result]], worlds: Sequence[One], *, full: Callable[[Exception], bool]
) -> list[Result]:
    """Answer all at once, or in halves where the device's memory does not hold them.

    Args:
        answer: answers some jobs.
        worlds: the jobs, ready to share a batch.
        full: whether an exception says that memory was short; others are raised.
    """
    try:
        return answer(worlds)
    except Exception as error:
        if not full(error) or len(worlds) == 1:
            raise
    middle = len(worlds) // 2
    return [*halved(answer, worlds[:middle], full=full), *halved(answer, worlds[middle:], full=full)]
