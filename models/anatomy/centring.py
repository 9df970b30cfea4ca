"""From a path of grid points to a smooth centreline that provably stays inside the lumen."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from haustra.errors import InvalidMeshError
from haustra.models.anatomy.frames import resample, smooth
from haustra.models.anatomy.rays import LumenRays

WORKING_STEP = 1e-3
"""Spacing of the points that are smoothed [m]."""
PATH_SMOOTHING = 6e-3
"""Standard deviation of the smoothing [m]: takes away the grid's staircase and the wiggle from fold to fold."""
KEEP_CLEAR = 0.6
"""A smoothed point keeps this share of the clearance of the path it came from..."""
ENOUGH_CLEARANCE = 6e-3
"""... or this much [m], the radius of an adult colonoscope."""
BLENDING_ROUNDS = 12
"""Rounds of giving way to the path where smoothing came too near to the wall."""


def smooth_inside(
    path: Float[np.ndarray, "points 3"],
    rays: LumenRays,
    clearance: Callable[[Float[np.ndarray, "points 3"]], Float[np.ndarray, " points"]],
) -> Float[np.ndarray, "stations 3"]:
    """Smooth a path that lies inside the lumen; every piece of the result stays inside it.

    Where smoothing would leave the lumen or come too near to the wall, the result is blended back to the path.

    Args:
        path: Positions [m] whose straight links stay inside the lumen.
        rays: The lumen surface.
        clearance: From positions [m] to their distance to the wall [m].

    Raises:
        InvalidMeshError: when no smooth path stays inside the lumen.
    """
    anchor = resample(path, WORKING_STEP)
    wanted = smooth(anchor, PATH_SMOOTHING / WORKING_STEP)
    needed = np.minimum(KEEP_CLEAR * clearance(anchor), ENOUGH_CLEARANCE)
    reach = int(2 * PATH_SMOOTHING / WORKING_STEP)
    weight, points = np.zeros(len(anchor)), wanted
    for attempt in range(BLENDING_ROUNDS):
        bad = _outside(points, anchor, rays) | (clearance(points) < needed)
        if not bad.any():
            return points
        raised = gaussian_filter1d(maximum_filter1d(bad.astype(float), 2 * reach + 1), reach / 2)
        weight = np.maximum(weight, (attempt + 1) / BLENDING_ROUNDS * raised)
        points = wanted + weight[:, None] * (anchor - wanted)
    if _outside(points, anchor, rays).any():
        raise InvalidMeshError("No smooth centreline stays inside the lumen: it is narrower than its triangles.")
    return points


def _outside(
    points: Float[np.ndarray, "points 3"], anchor: Float[np.ndarray, "points 3"], rays: LumenRays
) -> Bool[np.ndarray, " points"]:
    """Points that a wall parts from their anchor or from their successor."""
    parted = ~rays.clear(anchor, points)
    parted[:-1] |= ~rays.clear(points[:-1], points[1:])
    return parted
