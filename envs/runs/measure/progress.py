"""How far along the colon a point has come."""

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Centreline, Colon

_REACH = 0.06
"""How far along the centreline the nearest point may move between two calls [m]; keeps a tip that lies against a wall
from being counted into the loop on the other side."""


class ArcTracker:
    """Follows the arc length of the centreline point nearest to a moving tip."""

    def __init__(self, line: Centreline, *, start: float) -> None:
        """Begin at arc length `start` [m]."""
        self._line = line
        self.arc = start

    def update(self, point: Float[np.ndarray, "3"], way: Float[np.ndarray, "stations 3"] | None = None) -> float:
        """Arc length [m] nearest to `point` [m], within reach of the last one.

        Args:
            point: [m].
            way: where the centreline's stations are now [m], when the colon has moved.
        """
        line = self._line
        points = line.points if way is None else way
        low, high = np.searchsorted(line.arc, [self.arc - _REACH, self.arc + _REACH])
        near = slice(max(0, low), max(low + 1, high))
        distance = np.linalg.norm(points[near] - point, axis=1)
        self.arc = float(line.arc[near][np.argmin(distance)])
        return self.arc


def segment_at(colon: Colon, arc: float) -> str:
    """Name of the segment that arc length `arc` [m] lies in."""
    for segment in colon.segments:
        if arc <= segment.end:
            return segment.name
    return colon.segments[-1].name
