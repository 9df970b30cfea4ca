"""The learning curve: finished episodes as rows of a CSV file; several runs on one grid of steps."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidOptionError, UnreadableFileError
from haustra.files import write_atomically

EPISODE = ("return", "progress", "reached", "perforated", "seconds", "p_perforation", "pain")
"""What is noted of an episode that has ended."""
DEVICE_EPISODE = tuple(name for name in EPISODE if name != "pain")
"""What is noted of an episode of another device than a scope, which keeps no account of pain."""
WITHDRAWAL_EPISODE = (*EPISODE, "coverage")
"""What is noted of a withdrawal."""
_ROW = ("steps", "episodes")
COLUMNS = (*_ROW, *EPISODE)
"""Columns of a scope's curve."""
_MOST_BINS = 40
"""Largest number of bins in a common grid of steps: finer bins show the chance of single episodes."""


def begin_rows(path: Path, columns: Sequence[str], *, steps: int) -> None:
    """A file of rows that a training goes on with after so many steps; at none it begins anew.

    Rows of later steps, which the training will do again, are cut off.
    """
    head = ",".join(columns) + "\n"
    lines = path.read_bytes().decode().splitlines(keepends=True)[1:] if steps and path.exists() else []
    kept = [line for line in lines if int(line.partition(",")[0]) <= steps]
    write_atomically(path, lambda temporary: temporary.write_bytes((head + "".join(kept)).encode()))


class Curve:
    """Means over the episodes that ended lately, row by row."""

    def __init__(self, path: Path, *, steps: int, episodes_a_row: int = 16, episode: Sequence[str] = EPISODE) -> None:
        """Go on with the file after so many steps; a row is written once that many episodes have ended."""
        self._path, self._enough, self.episode = path, episodes_a_row, episode
        self._recent: list[Sequence[float]] = []
        begin_rows(path, (*_ROW, *episode), steps=steps)

    def add(self, steps: int, ended: Sequence[Sequence[float]]) -> dict[str, float]:
        """Note episodes that have ended after `steps`, each as `episode`; with none, write what is left.

        Returns:
            The means of the row, where so many have ended; else nothing.
        """
        self._recent.extend(ended)
        enough = len(self._recent) >= self._enough
        if not enough and (len(ended) or not self._recent):
            return {}
        means = np.mean(self._recent, axis=0)
        with self._path.open("a", encoding="utf-8", newline="") as file:
            csv.writer(file).writerow([steps, len(self._recent), *(f"{value:.5g}" for value in means)])
        self._recent = []
        return dict(zip(self.episode, means.tolist(), strict=True)) if enough else {}

    def last(self) -> dict[str, float]:
        """Return, progress and share that reached the end, of the last row."""
        with self._path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        if not rows:
            return {}
        return {f"last_{name}": float(rows[-1][name]) for name in self.episode}


def read_curve(path: Path) -> dict[str, np.ndarray]:
    """The columns of a curve.csv, each (rows,).

    Raises:
        UnreadableFileError: when it is none, or no episode has ended yet.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        noted = (episode for episode in (WITHDRAWAL_EPISODE, EPISODE) if rows and episode[-1] in rows[0])
        names = (*_ROW, *next(noted, DEVICE_EPISODE))
        table = np.array([[float(row[name]) for name in names] for row in rows]).reshape(-1, len(names))
    except (OSError, ValueError, KeyError, TypeError, csv.Error) as error:
        raise UnreadableFileError(f"'{path}' is no learning curve ({error}): name the folder of a training.") from error
    if len(table) == 0:
        raise UnreadableFileError(f"'{path}' has no rows yet: no episode of that training has ended.")
    if not np.isfinite(table).all() or (np.diff(table[:, 0]) < 0).any() or (table[:, 1] < 1).any():
        raise UnreadableFileError(f"'{path}' is no learning curve (its rows do not follow each other).")
    return dict(zip(names, table.T, strict=True))


@dataclass(frozen=True)
class SeedCurves:
    """Learning curves of one training with several seeds, on one grid of steps that all of them have done."""

    steps: Float[np.ndarray, " bins"]
    """Upper ends of the bins."""
    columns: dict[str, Float[np.ndarray, "runs bins"]]
    """Means over the episodes that ended in a bin, by the name of a column of curve.csv."""


def seed_curves(curves: Sequence[dict[str, np.ndarray]]) -> SeedCurves:
    """Put curves on one grid of steps, as fine as the coarsest of them allows.

    Raises:
        InvalidOptionError: when there is none.
    """
    if not curves:
        raise InvalidOptionError("Learning curves need at least one training.")
    count = min([_MOST_BINS, *(len(one["steps"]) for one in curves)])
    ends = min(one["steps"][-1] for one in curves) * np.arange(1, count + 1) / count
    columns = {
        name: np.stack([_binned(one["steps"], one[name], one["episodes"], ends) for one in curves])
        for name in curves[0]
        if name not in _ROW
    }
    return SeedCurves(ends, columns)


def _binned(steps: np.ndarray, values: np.ndarray, episodes: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Means by episodes; a bin in which no row was written lies on the line between its neighbours."""
    done = steps <= ends[-1]
    place = np.searchsorted(ends, steps[done])
    weight = np.bincount(place, episodes[done], len(ends))
    total = np.bincount(place, (values * episodes)[done], len(ends))
    full = weight > 0
    if not full.any():  # its first row comes after the other's last
        return np.full(len(ends), values[0])
    return np.interp(ends, ends[full], total[full] / weight[full])
