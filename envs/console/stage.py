"""The colon and the device in it as a page draws them: few triangles, wherever the colon has moved."""

from typing import Any

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.console.vehicle import Surroundings
from haustra.envs.runs.measure.injury import STATION_STEP
from haustra.envs.sim.moved_colon import CurrentColon

_SPACING = 0.01
"""Distance between rings of the colon in the console [m]."""
_AROUND = 28
"""Corners of a ring there."""


class Stage:
    """A colon as rings of corners, seen from outside."""

    def __init__(self, around: Surroundings, *, spacing: float = _SPACING, corners: int = _AROUND) -> None:
        """Take rings of so many corners that far apart [m] of the colon as its centreline sees it."""
        colon, tables = around.colon, around.tables
        line = colon.centreline
        rings = np.unique(np.linspace(0, len(line.arc) - 1, max(2, round(line.length / spacing))).astype(int))
        number = np.linspace(0, colon.radius.shape[1], corners, endpoint=False).astype(int)
        angles = 2 * np.pi * number / colon.radius.shape[1]
        circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        across = np.einsum("sij,aj->sai", line.frames[rings][:, :, :2], circle)
        self._middle = np.repeat(line.points[rings], corners, axis=0)
        self._out = (colon.radius[np.ix_(rings, number)][:, :, None] * across).reshape(-1, 3)
        self._arcs = np.repeat(line.arc[rings], corners)
        self._length = line.length
        self._moved = None if tables is None else CurrentColon(colon, tables, around.origin, around.axes)
        self.faces = _strips(len(rings), corners)
        """Corners of triangles, facing outwards."""
        self.stations = np.rint(self._arcs / STATION_STEP).astype(np.int32)
        """Station of each corner, as those of `haustra.envs.runs.measure.injury`."""

    def vertices(
        self, displacement: Float[np.ndarray, "nodes 7"] | None = None, widths: Float[np.ndarray, " rows"] | None = None
    ) -> Float[np.ndarray, "vertices 3"]:
        """Where corners are [m].

        Args:
            displacement: of the colon's axis; at rest when None.
            widths: of the lumen at even arc lengths, over that at rest [1]; as at rest when None.
        """
        points = self._middle + self._out * self._share(widths)
        if displacement is None or self._moved is None:
            return points
        return self._moved.to_current_all(displacement, points, self._arcs)

    def _share(self, widths: np.ndarray | None) -> Any:
        if widths is None:
            return 1.0
        return np.interp(self._arcs, np.linspace(0.0, self._length, len(widths)), widths)[:, None]


def _strips(rings: int, corners: int) -> Int[np.ndarray, "triangles 3"]:
    ring, corner = np.meshgrid(np.arange(rings - 1), np.arange(corners), indexing="ij")
    here, beside = ring * corners + corner, ring * corners + (corner + 1) % corners
    first = np.stack([here, beside, here + corners], axis=-1).reshape(-1, 3)
    second = np.stack([beside, beside + corners, here + corners], axis=-1).reshape(-1, 3)
    return np.concatenate([first, second]).astype(np.int32)
