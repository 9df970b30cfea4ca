"""A cloud of points on the lumen's wall becomes its surface.

The steps of the virtual-reality simulator's colon model (shared with Hoppe et al. 1992, doi 10.1145/142920.134011, and
Kazhdan, Bolitho, Hoppe 2006, Poisson surface reconstruction): normals from the covariance of the nearest neighbours,
one orientation along a minimum spanning tree, an indicator function from a Poisson equation, and its level surface.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.fft import dstn, idstn
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
from scipy.spatial import KDTree

from haustra.errors import InvalidMeshError
from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.isosurface import isosurface
from haustra.models.anatomy.lumen_grid import surface_samples
from haustra.models.anatomy.mesh_file import read_mesh
from haustra.models.anatomy.repair import Repaired, repair

FEWEST, MOST = 2_000, 3_000_000
"""Points that make a colon: at 2,000 they are 15 mm apart; at three million a grid of millimetres is full."""
NEIGHBOURS = 12
"""Points whose covariance gives a normal: two rings on an even surface."""
MAX_CELLS = 30_000_000
"""Cells of the grid on which the Poisson equation is solved: a gigabyte."""
MARGIN = 4
"""Empty cells around the points."""


def read_points(files: Sequence[Path]) -> Float[np.ndarray, "points 3"]:
    """Points from XYZ, CSV or mesh files, in the units that they share.

    Raises:
        UnreadableFileError: when a file cannot be read.
        InvalidMeshError: when there are too few points or too many.
    """
    points = np.concatenate([read_mesh(file).vertices for file in files])
    points = np.unique(points, axis=0)
    if not FEWEST <= len(points) <= MOST:
        raise InvalidMeshError(
            f"The files hold {len(points)} different points; a colon's surface needs {FEWEST} to {MOST}."
        )
    return points


def surface_through(points: Float[np.ndarray, "points 3"]) -> Repaired:
    """The closed surface through a cloud of points [m], and how far the points lie from it.

    Raises:
        InvalidMeshError: when the points lie on no surface.
    """
    tree = KDTree(points)
    distance, neighbour = map(np.asarray, tree.query(points, k=NEIGHBOURS + 1))
    if float(distance[:, -1].max()) == 0.0:
        raise InvalidMeshError("All points lie in one place: they are no surface.")
    normals, rough = _normals(points, neighbour)
    if rough > 0.5:
        raise InvalidMeshError("The points do not lie on a surface: most of them have no tangent plane.")
    normals = _oriented(points, normals, neighbour)
    area = np.pi * distance[:, -1] ** 2 / NEIGHBOURS
    step = float(np.median(distance[:, 1]))
    indicator, low, step = _indicator(points, normals * area[:, None], step)
    level = map_coordinates(indicator, ((points - low) / step).T, order=1)
    # Normals point out, so the indicator rises towards the inside, by one from far out to deep within.
    found = isosurface(indicator - float(np.average(level, weights=area)))
    repaired = repair(Surface(found.vertices * step + low, found.faces))
    away = KDTree(surface_samples(repaired.surface, step / 2)).query(points)[0]
    note = (
        f"The surface of {len(points)} points, on a grid of {step * 1e3:.2f} mm, is {np.median(away) * 1e3:.2f} mm "
        f"from them (median; 95 %: {np.percentile(away, 95) * 1e3:.2f} mm; at most {away.max() * 1e3:.1f} mm)."
    )
    return Repaired(repaired.surface, (note, *repaired.notes))


def _normals(points: np.ndarray, neighbour: np.ndarray) -> tuple[np.ndarray, float]:
    """Normal of the plane through each point's neighbours, and the share of points without one."""
    normals, flatness = np.empty_like(points), np.empty(len(points))
    for part in np.array_split(np.arange(len(points)), max(len(points) // 50_000, 1)):
        around = points[neighbour[part]]
        around = around - around.mean(1, keepdims=True)
        values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))
        normals[part], flatness[part] = vectors[:, :, 0], values[:, 0] / np.maximum(values[:, 1], 1e-30)
    return normals, float((flatness > 0.5).mean())


def _oriented(points: np.ndarray, normals: np.ndarray, neighbour: np.ndarray) -> np.ndarray:
    """Normals that all point out, carried from neighbour to neighbour along a minimum spanning tree.

    A link costs more the more its normals differ and the more it runs along them: so the tree keeps to the wall and
    does not jump to a loop that touches, whose wall is parallel but faces the other way.
    """
    n = len(points)
    one, two = np.repeat(np.arange(n), NEIGHBOURS), neighbour[:, 1:].ravel()
    link = points[two] - points[one]
    link /= np.maximum(np.linalg.norm(link, axis=1, keepdims=True), 1e-30)
    across = np.maximum(np.abs((link * normals[one]).sum(1)), np.abs((link * normals[two]).sum(1)))
    cost = 1.001 - np.abs((normals[one] * normals[two]).sum(1)) + 2 * across**2
    graph = coo_array((cost, (one, two)), shape=(n, n)).tocsr()
    graph = graph.maximum(graph.T)
    pieces, label = connected_components(graph, directed=False)
    tree = minimum_spanning_tree(graph)
    sign = np.ones(n)
    for piece in range(pieces):
        members = np.flatnonzero(label == piece) if pieces > 1 else np.arange(n)
        top = members[points[members, 2].argmax()]
        order, before = breadth_first_order(tree, top, directed=False)
        sign[top] = 1.0 if normals[top, 2] >= 0 else -1.0
        agree = np.sign((normals[order[1:]] * normals[before[order[1:]]]).sum(1))
        for point, same in zip(order[1:], agree, strict=True):
            sign[point] = sign[before[point]] * (same or 1.0)
    return normals * sign[:, None]


def _indicator(
    points: np.ndarray, weighted: np.ndarray, step: float
) -> tuple[Float[np.ndarray, "x y z"], Float[np.ndarray, "3"], float]:
    """Solve the Poisson equation whose right side is the divergence of the normals, zero on the box around.

    A sine transform solves it exactly on the grid.
    """
    extent = np.ptp(points, axis=0)
    step = max(step, float(np.cbrt(np.prod(extent + 2 * MARGIN * step) / MAX_CELLS)))
    low = points.min(0) - MARGIN * step
    shape = tuple(int(n) for n in np.ceil(extent / step) + 2 * MARGIN + 1)
    at = (points - low) / step
    cell, rest = np.floor(at).astype(np.int64), at - np.floor(at)
    divergence = np.zeros(shape)
    for axis in range(3):
        field = np.zeros(int(np.prod(shape)))
        for corner in np.ndindex(2, 2, 2):
            share = np.prod(np.where(corner, rest, 1 - rest), axis=1)
            flat = np.ravel_multi_index(tuple((cell + corner).T), shape)
            field += np.bincount(flat, weights=share * weighted[:, axis], minlength=len(field))
        smooth = gaussian_filter(field.reshape(shape), 1.0)
        divergence -= np.gradient(smooth / step**3, step, axis=axis)
    waves = [2 * np.cos(np.pi * np.arange(1, n + 1) / (n + 1)) - 2 for n in shape]
    eigenvalue = (waves[0][:, None, None] + waves[1][:, None] + waves[2]) / step**2
    solution = np.asarray(idstn(np.asarray(dstn(divergence, type=1)) / eigenvalue, type=1))
    solution[[0, -1]], solution[:, [0, -1]], solution[:, :, [0, -1]] = 0.0, 0.0, 0.0
    return solution, low, step
