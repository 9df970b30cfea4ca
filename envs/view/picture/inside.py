"""Where a lens is drawn from that stands in a soft wall: a tip that has pressed on would see nothing from outside."""

import numpy as np
from jaxtyping import Float

_ROOM = 0.004
"""The lens stays this far from the wall in its picture [m]: less than a tip's radius, since its wall is soft."""
_ALONG = 0.05
"""The station of the centreline beside a tip is sought this far on either side of the tip's arc length [m]."""


def lens_inside(
    points: Float[np.ndarray, "stations 3"],
    frames: Float[np.ndarray, "stations 3 3"],
    arcs: Float[np.ndarray, " stations"],
    radius: Float[np.ndarray, "stations angles"],
    tip: Float[np.ndarray, "3"],
    arc: float,
) -> Float[np.ndarray, "3"]:
    """Where the lens would be, had the wall not given way [m], in a colon at rest.

    Args:
        points: of the centreline [m].
        frames: columns are two normals and the direction there.
        arcs: arc lengths there [m].
        radius: distance to the wall there, by the angle from the first normal to the second [m].
        tip: where the tip is [m].
        arc: arc length there [m].
    """
    away = np.linalg.norm(points - tip, axis=1)
    row = int(np.where(np.abs(arcs - arc) < _ALONG, away, np.inf).argmin()) if arc > 0 else 0
    across = frames[row][:, :2]
    offset, along = (tip - points[row]) @ across, float((tip - points[row]) @ frames[row][:, 2])
    if row == len(points) - 1 and along > 0:  # beyond the caecum's end
        tip = tip - along * frames[row][:, 2]
    distance = float(np.linalg.norm(offset))
    turn = np.arctan2(offset[1], offset[0]) / (2 * np.pi) * radius.shape[1]
    most = max(float(radius[row, round(turn) % radius.shape[1]]) - _ROOM, 0.0)
    return tip if distance <= most else tip - across @ offset * (1 - most / distance)
