"""The colons of a study of scopes, tabulated for every radius that its designs have."""

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from pathlib import Path
from threading import Lock

import numpy as np

from haustra.envs.study.scope import colon_folder
from haustra.envs.study.study import Study
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.store import load_colon
from haustra.models.devices.scope.files import find_design
from haustra.models.scene import entry_of
from haustra.models.wall.lumen_table import Tables, lumen_table, stack, table_between
from haustra.models.wall.signed_distance import LumenDistance

RADIUS_STEP = 1e-4
"""Scopes take the table of the base design's radius, or of the nearest step of this from it [m], and touch sooner by
what is missing, at most half of this: depths are 1.8 um off then (p95, grown seed 0)."""
TABULATED = 10
"""Every so many steps a colon is tabulated; in between, tables are made of both neighbours. In the middle, 0.5 mm from
either, the place of first touch is 13 um off (p95, grown seeds 0 and 1), where tables themselves are 195 um off in
depth; their own error does not change (`tests/models/wall/test_lumen_table.py`)."""


class StudyColons:
    """A study's colons, each tabulated when it is first needed."""

    def __init__(self, study: Study, folder: Path, *, threads: int = 1) -> None:
        """Load them (`haustra.envs.study.scope.prepare_colons`); tables are made on so many threads."""
        names = list(map(str, study.conditions["colon"]))
        self.colons = {name: load_colon(colon_folder(folder, name)) for name in names}
        self.longest = max(self.colons.values(), key=lambda colon: colon.centreline.length)
        self._base = find_design("adult" if study.base == "default" else study.base).diameter / 2
        self._moves, self._threads = bool(study.options["mesentery"]), threads
        self._surfaces = {name: cache(partial(LumenDistance, colon)) for name, colon in self.colons.items()}
        self._tabulating = Lock()
        self._tables: dict[tuple[str, int], Tables] = {}

    def tabulate_for(self, radii: Iterable[float]) -> None:
        """Tabulate all colons for scopes of these radii [m], into the cache."""
        steps = {round((radius - self._base) / RADIUS_STEP) for radius in radii}
        with self._tabulating:
            self._tabulate({(name, knot) for name in self.colons for step in steps for knot in _knots(step)})

    def stacked(self, asked: Sequence[tuple[str, float]]) -> tuple[Tables, list[Colon], np.ndarray]:
        """Tables of what worlds need, their colons, and which of them each world's is.

        Args:
            asked: colon and scope's radius of each world [m].
        """
        rows = [(name, round((radius - self._base) / RADIUS_STEP)) for name, radius in asked]
        kinds = sorted(set(rows))
        with self._tabulating:
            self._tabulate({(name, knot) for name, step in kinds for knot in _knots(step)})
        tables = stack([self._between(*row) for row in kinds])
        return tables, [self.colons[name] for name, _ in kinds], np.array([kinds.index(row) for row in rows])

    def _between(self, name: str, step: int) -> Tables:
        first, last = _knots(step)
        radius = self._base + step * RADIUS_STEP
        return table_between(self._tables[name, first], self._tables[name, last], radius)

    def _tabulate(self, knots: set[tuple[str, int]]) -> None:
        missing = sorted(knots - self._tables.keys())
        with ThreadPoolExecutor(self._threads) as pool:
            for knot, found in zip(missing, pool.map(self._tabulated, missing), strict=True):
                self._tables[knot] = found

    def _tabulated(self, knot: tuple[str, int]) -> Tables:
        name, step = knot
        colon, radius = self.colons[name], self._base + step * RADIUS_STEP
        found = lumen_table(colon, device_radius=radius, surface=self._surfaces[name], with_mesentery=self._moves)
        return found.seen_from(*entry_of(colon))


def _knots(step: int) -> tuple[int, int]:
    """Tabulated steps on both sides of a step."""
    first = step // TABULATED * TABULATED
    return first, first if first == step else first + TABULATED
