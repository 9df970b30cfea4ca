"""The wall as a device indents it: the surface that cameras see, and that is saved, has the device inside.

The wall gives way by force over stiffness, up to the device's own width, while the lumen's surface is that of a wall
nobody touches. Here each vertex near the device is moved out along its ray from the centreline until the device is
within, and what surrounds it goes along, on a slope: a tent, not a cliff. Only what is drawn and saved is changed.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.wall.signed_distance import ANUS

APART = 0.001
"""Distance between the places of the device's axis that are looked at [m]."""
GAP = 5e-4
"""The wall is drawn so far off the device [m]: flat triangles cut a round device's corners by 0.4 mm where their edges
are 4.5 mm long."""
SLOPE = 0.5
"""How steeply the indented wall rises beside the device [1]; engineering choice, so that no triangle turns over."""
_WINDOW = 0.03
"""A place of the device is next to a station at most so far from the place before it [m]."""


def indented(
    colon: Colon, arcs: Float[np.ndarray, " vertices"], path: Float[np.ndarray, "nodes 3"], *, radius: float
) -> Colon:
    """The colon, its surface moved out of a device's way.

    Args:
        colon: where it is now.
        arcs: arc length of each vertex of its surface [m].
        path: the device's axis past the anus, from there to the tip [m].
        radius: of the device [m].
    """
    if len(path) < 2:
        return colon
    line, vertices = colon.centreline, colon.lumen.vertices
    places = _along(path)
    at = _followed(places, line.points, line.arc)
    centres = np.column_stack([np.interp(arcs, line.arc, line.points[:, axis]) for axis in range(3)])
    rays = vertices - centres
    lengths = np.maximum(np.linalg.norm(rays, axis=1), 1e-9)
    rays /= lengths[:, None]
    wanted = np.maximum(_reached(places, at, centres, rays, arcs, radius + GAP) - lengths, 0.0)
    wanted[arcs <= ANUS] = 0.0  # the lid there is no wall: the device comes in through it
    moved = _tent(vertices, colon.lumen.faces, wanted)
    return replace(colon, lumen=Surface(vertices + moved[:, None] * rays, colon.lumen.faces))


def _along(path: np.ndarray) -> np.ndarray:
    """Places every `APART` of a path."""
    behind = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    own = np.linspace(0.0, behind[-1], int(np.ceil(behind[-1] / APART)) + 1)
    return np.column_stack([np.interp(own, behind, path[:, axis]) for axis in range(3)])


def _followed(places: np.ndarray, stations: np.ndarray, arcs: np.ndarray) -> np.ndarray:
    """Arc lengths of the stations next to places that follow each other from the anus on."""
    reach = int(np.ceil(_WINDOW / (arcs[1] - arcs[0])))
    found = np.zeros(len(places), int)
    last = 0
    for row, place in enumerate(places):
        first = max(last - reach, 0)
        near = stations[first : last + reach + 1] - place
        last = first + int((near * near).sum(axis=1).argmin())
        found[row] = last
    return arcs[found]


def _reached(
    places: np.ndarray, at: np.ndarray, centres: np.ndarray, rays: np.ndarray, arcs: np.ndarray, radius: float
) -> np.ndarray:
    """How far out along each vertex's ray the device reaches [m]; 0 where it does not cross it."""
    order = np.argsort(arcs)
    low, high = (np.searchsorted(arcs[order], at + side * 2 * radius) for side in (-1, 1))
    out = np.zeros(len(arcs))
    for place, first, last in zip(places, low, high, strict=True):
        some = order[first:last]
        away = place - centres[some]
        along = np.einsum("vi,vi->v", away, rays[some])
        room = radius**2 - (np.einsum("vi,vi->v", away, away) - along**2)
        crossed = room > 0
        some = some[crossed]
        out[some] = np.maximum(out[some], along[crossed] + np.sqrt(room[crossed]))
    return out


def _tent(vertices: np.ndarray, faces: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """How far each vertex goes [m]: as far as is wanted of it, or of one near by, less the slope between them."""
    poles = np.flatnonzero(wanted > 0)
    if not len(poles):
        return wanted
    edges = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    falls = SLOPE * np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    far = wanted.max() / SLOPE
    near = KDTree(vertices[poles]).query(vertices, distance_upper_bound=far)[0] < np.inf
    edges, falls = edges[near[edges].any(axis=1)], falls[near[edges].any(axis=1)]
    moved = wanted.copy()
    for _ in range(int(np.ceil(far / APART))):
        before = moved.copy()
        for here, there in ((0, 1), (1, 0)):
            np.maximum.at(moved, edges[:, here], before[edges[:, there]] - falls)
        if np.array_equal(before, moved):
            break
    return moved
