"""Whether the scope is still inside the colon."""

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Colon

ESCAPE_DEPTH = 0.03
"""A scope that stands this far outside the lumen has left the colon [m]: the default wall is no thicker."""

_LARGEST_RADIUS = 0.06
"""Radii above this are looks along the lumen, not across [m]."""

_BLUR = 0.01
"""The lumen is as wide as within this stretch of centreline on either side [m]: folds are thinner."""

_PATH_STRETCH = (0.35, 2.2)
"""Least and most centreline per length of scope that a search allows: scopes cut corners and lie in loops."""
_PLEATED = 3.0
"""By how much more centreline a length of scope may have gathered where the colon moves."""


class Containment:
    """Measures how far a scope stands outside a colon's lumen, from the radius field.

    A bound, not a distance: the lumen is taken as round with its largest radius within a centimetre, so a scope that
    lies in a haustrum counts as inside, and one that has left through the wall is seen once it is clear of it.
    """

    def __init__(self, colon: Colon, *, radius: float) -> None:
        """For a scope of that radius [m]."""
        line = colon.centreline
        self._points, self._arc = line.points, line.arc
        widest = np.minimum(colon.radius, _LARGEST_RADIUS).max(axis=1)
        reach = int(np.ceil(_BLUR / (line.arc[1] - line.arc[0])))
        windows = np.lib.stride_tricks.sliding_window_view(np.pad(widest, reach, mode="edge"), 2 * reach + 1)
        self._room = windows.max(axis=1) - radius
        self._squares = np.einsum("ij,ij->i", self._points, self._points)

    def outside(
        self,
        nodes: Float[np.ndarray, "nodes 3"],
        behind: Float[np.ndarray, " nodes"],
        tip_arc: float,
        way: Float[np.ndarray, "stations 3"] | None = None,
    ) -> float:
        """How far the node that is furthest out stands outside the lumen [m]; negative when all are inside.

        Args:
            nodes: points on the scope's axis inside the patient [m].
            behind: their distances from the tip along the scope [m].
            tip_arc: arc length of the tip [m].
            way: where the centreline's stations are now [m], when the colon has moved.
        """
        points = self._points if way is None else way
        of_points = self._squares if way is None else np.einsum("ij,ij->i", way, way)
        if not len(nodes):
            return -float(self._room.min())
        least, most = _PATH_STRETCH
        most *= 1.0 if way is None else _PLEATED
        low, high = tip_arc - most * behind - _BLUR, tip_arc - least * behind + _BLUR
        passed = slice(0, max(1, int(np.searchsorted(self._arc, high.max(), side="right"))))
        candidates = (self._arc[passed] >= low[:, None]) & (self._arc[passed] <= high[:, None])
        candidates[:, 0] |= ~candidates.any(axis=1)
        # One product of matrices instead of a difference for every pair: half the time of a check.
        squares = np.einsum("ij,ij->i", nodes, nodes)[:, None] - 2 * nodes @ points[passed].T
        distance = np.sqrt(np.maximum(squares + of_points[passed], 0.0)) - self._room[passed]
        return float(np.where(candidates, distance, np.inf).min(axis=1).max())
