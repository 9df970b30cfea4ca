"""The learning curve: finished episodes as rows of a CSV file."""

import csv
from pathlib import Path
from typing import Any

import numpy as np


class Curve:
    """Means over the episodes that ended lately, row by row."""

    def __init__(self, path: Path, *, fresh: bool, episodes_a_row: int = 16) -> None:
        """Go on with the file, or begin a `fresh` one; a row is written once that many episodes have ended."""
        self._path, self._enough = path, episodes_a_row
        self._recent: list[list[float]] = []
        if fresh:
            path.write_text("steps,episodes,return,progress,reached,perforated,seconds\n", encoding="utf-8")

    def add(self, steps: int, ended: list[dict[str, Any]]) -> None:
        """Note episodes that have ended after `steps`; with none, write what is left."""
        self._recent += [
            [one["episode"]["r"], one["progress"], float(one["reached"]), float(one["perforated"]), one["time"]]
            for one in ended
        ]
        if len(self._recent) >= self._enough or (not ended and self._recent):
            means = np.mean(self._recent, axis=0)
            with self._path.open("a", encoding="utf-8", newline="") as file:
                csv.writer(file).writerow([steps, len(self._recent), *(f"{value:.5g}" for value in means)])
            self._recent = []

    def last(self) -> dict[str, float]:
        """Return, progress and share that reached the end, of the last row."""
        with self._path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        if not rows:
            return {}
        return {f"last_{name}": float(rows[-1][name]) for name in ("return", "progress", "reached", "perforated")}
