"""How much of the mucosa a camera has seen: cells of the wall that were in view, near, and not behind a fold."""

import math

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.sight import Sight
from haustra.models.anatomy.surface_landmarks import inspection_number

CELL = 0.005
"""Length of a cell along the colon [m]; it is a twenty-fourth of the circumference wide: about 5 mm."""
AROUND = 24
"""Cells around the colon."""
NEAR = inspection_number("near")
"""A cell farther from the camera than this [m] does not count as seen."""
_BETWEEN = np.linspace(0.2, 0.9, 6)
"""Places on the line of sight that must lie in the lumen."""


class Coverage:
    """Cells seen, world by world."""

    def __init__(self, bank: ColonSet, sight: Sight, worlds: int, *, field_of_view_deg: float) -> None:
        """Nothing seen yet; a cell counts within `field_of_view_deg` of full viewing angle."""
        self._bank, self._sight = bank, sight
        self._rows = [np.rint(np.arange(0, case.length, CELL) / case.step).astype(int) for case in bank.cases]
        self._columns = np.arange(AROUND) * bank.cases[0].sight.shape[1] // AROUND
        self._cosine = math.cos(math.radians(min(field_of_view_deg, 359.0) / 2))
        self._seen = [np.zeros((0, AROUND), bool) for _ in range(worlds)]

    def begin(self, world: int, case: int) -> None:
        """Forget what one world has seen."""
        self._seen[world] = np.zeros((len(self._rows[case]), AROUND), bool)

    def look(
        self, world: int, case: int, eye: Float[np.ndarray, "3"], ahead: Float[np.ndarray, "3"], arc: float
    ) -> float:
        """Look from `eye` [m] along the unit vector `ahead`; the share of all cells seen so far."""
        seen = self._seen[world]
        low, high = (int(np.clip((arc + off) / CELL, 0, len(seen))) for off in (-NEAR - CELL, NEAR + CELL))
        fresh = np.argwhere(~seen[low:high])
        if len(fresh):
            fresh[:, 0] += low
            places = self._sight.surface(case, self._rows[case][fresh[:, 0]], self._columns[fresh[:, 1]])
            visible = self._visible(case, places, CELL * fresh[:, 0], eye, ahead, arc)
            seen[fresh[visible, 0], fresh[visible, 1]] = True
        return float(seen.mean())

    def _visible(
        self, case: int, places: np.ndarray, arcs: np.ndarray, eye: np.ndarray, ahead: np.ndarray, arc: float
    ) -> Bool[np.ndarray, " places"]:
        way = places - eye
        distance = np.linalg.norm(way, axis=1)
        near = (distance < NEAR) & (way @ ahead > self._cosine * distance)
        chosen = np.flatnonzero(near)
        points = eye + _BETWEEN[None, :, None] * way[chosen, None]
        guess = arc + _BETWEEN[None, :] * (arcs[chosen, None] - arc)
        inside = self._sight.inside(np.array([case]), points.reshape(1, -1, 3), guess.reshape(1, -1))
        near[chosen] = inside.reshape(len(chosen), len(_BETWEEN)).all(axis=1)
        return near
