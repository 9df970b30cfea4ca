"""Weight of the water in worlds' colons, on the nodes of the axes of colons that move."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.landmarks import SEGMENTS, segment_names
from haustra.models.gas.water import water_load
from haustra.models.wall.mesentery import Mesentery


class WaterWeight:
    """What each segment's water does to each node: the nodes that lie in a segment share its water evenly."""

    def __init__(self, colons: Sequence[Colon], hung: Mesentery) -> None:
        """Find which nodes lie in which segments.

        Args:
            colons: as they were given.
            hung: their mesenteries, stacked: those of all colons once, or several times one after the other.
        """
        self._down, spacing = np.asarray(hung.down, float), np.asarray(hung.spacing, float)
        nodes = hung.nodes.shape[1]
        owners = [colons[number % len(colons)] for number in range(len(spacing))]
        self._share = np.stack([_shares(colon, nodes, step) for colon, step in zip(owners, spacing, strict=True)])

    def loads(
        self, which: Int[np.ndarray, " some"], water: Float[np.ndarray, "some segments"]
    ) -> Float[np.ndarray, "some nodes 3"]:
        """Weight on the nodes of these mesenteries [N], with so much water in each segment [m^3]."""
        return water_load(np, water, self._share[which], self._down[which])


def _shares(colon: Colon, nodes: int, spacing: float) -> Float[np.ndarray, "nodes segments"]:
    """Share of each segment's water that each node bears [1]; nothing behind the colon's last."""
    arcs = np.arange(round(colon.centreline.length / spacing) + 1) * spacing
    inside = np.array(segment_names(colon.segments, arcs))[:, None] == np.array(SEGMENTS)
    return np.pad(inside / np.maximum(inside.sum(axis=0), 1), ((0, nodes - len(arcs)), (0, 0)))
