"""When a study's processes grew colons, stepped patients and measured: what a cohort costs, part by part."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from haustra.errors import UnreadableFileError

COSTS = "costs.jsonl"
"""What a folder's processes add lines to, beside its store."""
Part = Literal["growing", "stepping", "measuring"]


@contextmanager
def counted(folder: Path, part: Part) -> Iterator[None]:
    """Note when a part of the work began and ended, in one line that no other process's can come between."""
    began = time.time()
    try:
        yield
    finally:
        line = json.dumps({"part": part, "began": began, "ended": time.time()}) + "\n"
        with (folder / COSTS).open("a", encoding="utf-8") as file:
            file.write(line)


def costs(folder: Path) -> dict[str, float]:
    """For how long any process did each part, on the clock, in all calls so far [s]; nothing of what nobody did.

    Raises:
        UnreadableFileError: when a line is damaged.
    """
    spans: dict[str, list[tuple[float, float]]] = {}
    if (folder / COSTS).is_file():
        for line in (folder / COSTS).read_text(encoding="utf-8").splitlines():
            try:
                noted = json.loads(line)
                spans.setdefault(noted["part"], []).append((noted["began"], noted["ended"]))
            except (ValueError, KeyError, TypeError) as error:
                raise UnreadableFileError(
                    f"'{folder / COSTS}' is damaged ({error}): delete it; rows are kept."
                ) from error
    return {part: _together(sorted(each)) for part, each in spans.items()}


def _together(spans: list[tuple[float, float]]) -> float:
    """Length of what sorted spans cover together."""
    covered, upto = 0.0, float("-inf")
    for began, ended in spans:
        covered += max(ended - max(began, upto), 0.0)
        upto = max(upto, ended)
    return covered
