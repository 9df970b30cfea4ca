"""Memory of a process and of those that it started, as Linux tells it, and how flat it stays."""

import os
import resource
from collections.abc import Sequence
from pathlib import Path

import numpy as np

_WARM, _END = (0.1, 0.2), (0.9, 1.0)
"""Shares of a run between whose medians memory is compared: not before it has warmed up."""


def resident(process: int) -> float:
    """Memory of one process [MB]; nothing of one that has ended."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1])
    except (OSError, IndexError):
        return 0.0
    return pages * resource.getpagesize() / 1e6


def offspring(process: int) -> list[int]:
    """Processes that a process has started, and those that these have, and so on; those of all of its threads."""
    found: list[int] = []
    for tasks in Path(f"/proc/{process}/task").glob("*/children"):
        try:
            children = [int(word) for word in tasks.read_text(encoding="ascii").split()]
        except OSError:
            continue
        found += [each for child in children for each in (child, *offspring(child))]
    return found


def groups(browser: int) -> dict[str, float]:
    """Memory of this process, of what it started besides a browser, and of that browser with all it started [MB]."""
    seen_by = [browser, *offspring(browser)]
    others = [process for process in offspring(os.getpid()) if process not in seen_by]
    parts = {"server": [os.getpid()], "children": others, "browser": seen_by}
    return {name: sum(map(resident, processes)) for name, processes in parts.items()}


def flatness(samples: Sequence[dict[str, float]]) -> dict[str, float]:
    """Median memory of each group once it was warm, and by how much it had grown at the end [MB]."""
    found = {}
    for name in samples[0]:
        values = [sample[name] for sample in samples]
        warm, end = (_median(values, *span) for span in (_WARM, _END))
        found |= {f"{name}_MB": warm, f"{name}_growth_MB": end - warm}
    return found


def _median(values: Sequence[float], first: float, last: float) -> float:
    begin = min(int(first * len(values)), len(values) - 1)
    return float(np.median(values[begin : max(int(np.ceil(last * len(values))), begin + 1)]))
