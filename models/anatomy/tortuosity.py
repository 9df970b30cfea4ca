"""How winding a colon's course is."""

import numpy as np
from jaxtyping import Float
from scipy.signal import find_peaks

from haustra.models.anatomy.frames import arc_length, resample, tangents

STEP = 5e-3
"""Spacing at which turns are measured [m]."""
WINDOW = 0.08
"""Arc length over which a flexure turns [m], and by which two are apart: four times a flexure's usual radius and half
of it is a quarter turn."""
ACUTE = np.pi / 2
"""Turn from which on a flexure counts as acute [rad]: its two arms then form an angle below 90 degrees."""


def acute_flexures(points: Float[np.ndarray, "points 3"]) -> int:
    """Number of places where the course turns by a right angle or more within `WINDOW`.

    Khashab 2009 (doi 10.1055/s-0029-1214899) counted acute-angle flexures by eye on a three-dimensional map; how acute
    and over what length is not said, so both are engineering choices here.
    """
    line = resample(points, STEP)
    tangent = tangents(line)
    reach = round(WINDOW / STEP)
    if len(line) <= reach:
        return 0
    turn = np.arccos(np.clip((tangent[reach:] * tangent[:-reach]).sum(1), -1.0, 1.0))
    padded = np.concatenate([[0.0], turn, [0.0]])
    return len(find_peaks(padded, height=ACUTE, distance=reach)[0])


def arc_over_chord(points: Float[np.ndarray, "points 3"]) -> float:
    """Length of a course over the distance between its ends [1]."""
    return float(arc_length(points)[-1] / np.linalg.norm(points[-1] - points[0]))
