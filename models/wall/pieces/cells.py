"""Cells: a partition of the space around the colon into convex regions, one for each stretch of the centreline.

A cell is what lies nearer to its own site on the centreline than to any other, distance d being measured as d^2 - r^2
(a power diagram, Aurenhammer 1987, doi 10.1137/0216006), r being the local radius of the lumen. Power cells are convex
and fill space without overlap, so the three things that a wall must not do are settled by construction: cells of the
inside of a bend end at its centre of curvature, the gap between two loops is shared where they touch, and no stretch
of the wall is left without a cell.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from manifold3d import Manifold

from haustra.models.anatomy.colon import Colon

ENTRY_LENGTH = 0.010
"""How far the wall reaches back beyond the anal end of the centreline [m]."""
WEIGHT_SLOPE = 0.5
"""Largest step of r^2 between neighbouring sites over their squared distance: beyond 1 a site leaves its cell."""
REACH_MARGIN = 0.030
"""Room beyond radius and thickness [m] for haustra that bulge further than the radius field sees."""
LARGEST_RADIUS = 0.060
"""Radius [m] above which the radius field looks along the lumen, not across: a caecum is below 9 cm wide."""

Plane = tuple[Float[np.ndarray, " 3"], float]
"""Outward unit normal n and offset d [m] of the half-space n.x <= d."""


@dataclass(frozen=True)
class Site:
    """Where on the centreline a cell sits."""

    start: float
    """Arc length where its stretch begins [m]."""
    end: float
    """Arc length where its stretch ends [m]."""
    point: Float[np.ndarray, " 3"]
    """Position [m]."""
    frame: Float[np.ndarray, "3 3"]
    """Columns: first normal, second normal, tangent."""
    radius: float
    """Mean distance from the centreline to the wall [m]."""
    reach: float
    """Largest such distance [m]."""


@dataclass(frozen=True)
class Cell:
    """A convex region around a site."""

    site: Site
    """Its stretch of the centreline."""
    region: Manifold
    """Its solid, before the lumen is taken out."""
    planes: tuple[Plane, ...]
    """Half-spaces whose intersection it is."""


def place_sites(colon: Colon, *, spacing: float) -> tuple[Site, ...]:
    """Sites at equal distance of about `spacing` [m], on the centreline smoothed over one spacing."""
    from scipy.ndimage import uniform_filter1d  # here, since children that only split blocks start faster without

    line = colon.centreline
    count = max(2, round(line.length / spacing))
    bounds = np.linspace(0.0, line.length, count + 1)
    width = max(1, round(spacing / (line.length / (len(line.arc) - 1))))
    smooth = uniform_filter1d(line.points, width, axis=0, mode="nearest")
    radius = np.minimum(colon.radius, LARGEST_RADIUS)
    sites = []
    for start, end in pairwise(bounds):
        middle = 0.5 * (start + end)
        near = np.abs(line.arc - middle) <= spacing
        tangent = _at(line, smooth, end) - _at(line, smooth, start)
        first = line.frames[np.searchsorted(line.arc, middle)][:, 0]
        point = _at(line, smooth, middle)
        sites.append(
            Site(start, end, point, _frame(tangent, first), float(radius[near].mean()), float(radius[near].max()))
        )
    return tuple(sites)


def power_cells(sites: tuple[Site, ...], *, thickness: float) -> Iterator[Cell]:
    """The power cell of each site, cut to a box that holds its lumen and a wall of `thickness` [m]."""
    points = np.array([site.point for site in sites])
    weights = _weights(points, np.array([site.radius for site in sites]))
    for index, site in enumerate(sites):
        half = site.reach + thickness + REACH_MARGIN
        region, planes = _box(site, half, back=ENTRY_LENGTH + site.end - site.start if index == 0 else half)
        offsets = points - site.point
        squared = np.einsum("ij,ij->i", offsets, offsets)
        for other in np.argsort(squared)[1:]:
            distance = np.sqrt(squared[other])
            along = 0.5 * (squared[other] + weights[index] - weights[other]) / distance
            if along > np.sqrt(3.0) * half:
                continue
            normal = offsets[other] / distance
            offset = float(normal @ site.point + along)
            if (_corners(region) @ normal).max() > offset:
                region = region.trim_by_plane(tuple(-normal), -offset)
                planes.append((normal, offset))
                if region.is_empty():
                    break
        if not region.is_empty():
            yield Cell(site, region, tuple(planes))


def _weights(points: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Squared radii, levelled until no site is pushed out of its own cell by a neighbour."""
    weights = radius**2
    allowed = WEIGHT_SLOPE * np.sum(np.diff(points, axis=0) ** 2, axis=1)
    for i in range(1, len(weights)):
        weights[i] = min(weights[i], weights[i - 1] + allowed[i - 1])
    for i in range(len(weights) - 2, -1, -1):
        weights[i] = min(weights[i], weights[i + 1] + allowed[i])
    return weights


def _box(site: Site, half: float, *, back: float) -> tuple[Manifold, list[Plane]]:
    size = (2 * half, 2 * half, half + back)
    centre = site.point + site.frame[:, 2] * 0.5 * (half - back)
    region = Manifold.cube(size, True).transform(np.column_stack([site.frame, centre]))
    planes = []
    for axis, extent in enumerate(size):
        for sign in (1.0, -1.0):
            normal = sign * site.frame[:, axis]
            planes.append((normal, float(normal @ centre + 0.5 * extent)))
    return region, planes


def _corners(region: Manifold) -> np.ndarray:
    return np.asarray(region.to_mesh64().vert_properties)[:, :3]


def _at(line, points: np.ndarray, arc: float) -> np.ndarray:
    return np.array([np.interp(arc, line.arc, points[:, axis]) for axis in range(3)])


def _frame(tangent: np.ndarray, first: np.ndarray) -> np.ndarray:
    tangent = tangent / np.linalg.norm(tangent)
    first = first - (first @ tangent) * tangent
    first = first / np.linalg.norm(first)
    return np.column_stack([first, np.cross(tangent, first), tangent])
