"""From a path of grid points to a smooth centreline that provably stays inside the lumen."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from haustra.errors import InvalidMeshError
from haustra.models.anatomy.frames import resample, smooth_keeping_bends
from haustra.models.anatomy.rays import LumenRays

WORKING_STEP = 1e-3
"""Spacing of the points that are smoothed [m]."""
PATH_SMOOTHING = 10e-3
"""Standard deviation of the smoothing [m]: takes away the grid's staircase and the wiggle from fold to fold."""
KEEP_CLEAR = 0.6
"""A smoothed point keeps this share of the clearance of the path it came from..."""
ENOUGH_CLEARANCE = 6e-3
"""... or this much [m], the radius of an adult colonoscope."""
FROM_POLE = 2e-3
"""A centreline that is led on to the end of the lumen stops this far before it [m]: its rays still look across."""
LONGEST_LEAD = 0.02
"""At most this much is led on straight [m]: no end that a scope has room in is rounder than a lumen 40 mm wide."""
END_DIRECTION = 0.01
"""Stretch at an end over which its direction is taken [m]."""
END_RAYS = 16
"""Rays across each point that is led on."""
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
    wanted = smooth_keeping_bends(anchor, PATH_SMOOTHING / WORKING_STEP)
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


def lead_to_ends(points: Float[np.ndarray, "points 3"], rays: LumenRays) -> Float[np.ndarray, "stations 3"]:
    """Lead a centreline straight on at both ends, up to the end of the lumen.

    A path that keeps clear of the wall on all sides stops one radius short of a blind end or of the lid over the anus.
    It is led on as long as there is room for an adult colonoscope to every side, so not into an appendix.

    Args:
        points: Positions [m] inside the lumen, `WORKING_STEP` apart.
        rays: The lumen surface.
    """
    caecal = _lead(points, rays)
    return np.concatenate([_lead(points[::-1], rays)[::-1], points, caecal])


def _lead(points: Float[np.ndarray, "points 3"], rays: LumenRays) -> Float[np.ndarray, "more 3"]:
    """What follows the last point, if anything."""
    back = points[-min(1 + round(END_DIRECTION / WORKING_STEP), len(points))]
    onwards = (points[-1] - back) / np.linalg.norm(points[-1] - back)
    ahead = float(rays.cast(points[-1:], onwards[None, None])[0, 0])
    length = min(ahead - FROM_POLE, LONGEST_LEAD)
    count = int(length / WORKING_STEP)
    if count < 1:
        return np.empty((0, 3))
    led = points[-1] + WORKING_STEP * np.arange(1, count + 1)[:, None] * onwards
    aside = np.linalg.svd(onwards[None])[2][1:]
    turn = 2 * np.pi * np.arange(END_RAYS) / END_RAYS
    across = np.stack([np.cos(turn), np.sin(turn)], axis=1) @ aside
    room = rays.cast(led, np.broadcast_to(across, (count, END_RAYS, 3))).min(1)
    tight = np.flatnonzero(room < ENOUGH_CLEARANCE)
    return led[: tight[0]] if len(tight) else led


def _outside(
    points: Float[np.ndarray, "points 3"], anchor: Float[np.ndarray, "points 3"], rays: LumenRays
) -> Bool[np.ndarray, " points"]:
    """Points that a wall parts from their anchor or from their successor."""
    parted = ~rays.clear(anchor, points)
    parted[:-1] |= ~rays.clear(points[:-1], points[1:])
    return parted
