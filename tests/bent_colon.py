"""Colons of known shape with bends: tubes of 20 mm radius along arcs and straights, and walls for them."""

from collections.abc import Sequence

import numpy as np

from haustra.models.anatomy.colon import Colon
from haustra.models.wall.pieces.build import build_wall
from haustra.models.wall.pieces.wall import Wall
from tests.models.wall.conftest import swept_colon


def winding(parts: Sequence[tuple[float, float]]) -> np.ndarray:
    """Points every 3 mm in the plane z = 0 along parts of given length [m] and turn to the left [rad]."""
    ends = np.cumsum([0.0, *(length for length, _ in parts)])
    arc = np.linspace(0.0, ends[-1], round(ends[-1] / 0.003) + 1)
    heading = np.interp(arc, ends, np.cumsum([0.0, *(turn for _, turn in parts)]))
    step = np.diff(arc, prepend=0.0)
    return np.column_stack([np.cumsum(np.cos(heading) * step), np.cumsum(np.sin(heading) * step), np.zeros(len(arc))])


def bent_colon(parts: Sequence[tuple[float, float]], *, name: str = "bent tube") -> tuple[Colon, Wall]:
    """A tube and its wall of prisms."""
    colon = swept_colon(winding(parts), name=name)
    with np.errstate(invalid="ignore"):  # rays at the open ends, where seams are measured, find no wall
        wall = build_wall(colon, method="prism", rays=1000, workers=1, use_cache=False)
    return colon, wall
