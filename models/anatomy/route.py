"""The way through the lumen from one end to the other, on its grid graph."""

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse.csgraph import dijkstra

from haustra.models.anatomy.lumen_grid import LumenGraph

CENTRING_POWER = 5
"""Cost of a link is its length over clearance to this power: from 2 upwards the path keeps to the middle in bends. At
3, short ways past folds cost as much as wide ones, so that a voxel's noise decides; above 5 lengths hardly change
(docs/validation/input.md)."""
CLEARANCE_FLOOR = 0.2
"""Clearance counts at least this share of the grid spacing, so that links at the wall stay finite."""


def lumen_ends(graph: LumenGraph) -> tuple[int, int]:
    """The two points that are farthest from each other inside the lumen: the blind ends of the tube.

    A double sweep: the farthest point from anywhere is one end, the farthest from that end is the other.
    """
    matrix = graph.matrix(graph.lengths)
    first = int(np.argmax(dijkstra(matrix, indices=0)))
    return first, int(np.argmax(dijkstra(matrix, indices=first)))


def farthest_from(graph: LumenGraph, start: int) -> int:
    """The point that is farthest from `start` inside the lumen."""
    return int(np.argmax(dijkstra(graph.matrix(graph.lengths), indices=start)))


def nearest_point(graph: LumenGraph, position: Float[np.ndarray, "3"]) -> int:
    """The grid point nearest to a position [m]."""
    return int(np.argmin(np.linalg.norm(graph.points - position, axis=1)))


def middle_route(graph: LumenGraph, start: int, end: int) -> Int[np.ndarray, " points"]:
    """Indices of the path from start to end that keeps to the middle of the lumen."""
    floor = CLEARANCE_FLOOR * graph.spacing
    clearance = np.maximum(graph.clearance[graph.links].min(1), floor)
    cost = graph.lengths * (float(graph.clearance.max()) / clearance) ** CENTRING_POWER
    _, previous = dijkstra(graph.matrix(cost), indices=start, return_predecessors=True)
    path = [end]
    while path[-1] != start:
        path.append(int(previous[path[-1]]))
    return np.array(path[::-1])
