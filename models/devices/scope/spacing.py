"""Joints where the colon needs them: spacing from lumen radius and curvature, after the simulator paper's eq. 2.

The paper splits each rod of mean length l into 2^n, or merges 2^-n of them, with

    n = ceil(log2(l / ((r_c + d_v / 2) sqrt(2 (1 - cos psi))))),

r_c the lumen's radius of curvature, d_v its diameter, psi the largest bend of a joint: the chord that subtends psi on
the outer wall of the bend bounds the rod. The paper changes rods as the scope passes marked places; here the whole
scope is cut once, when the scene is built: a place `s` behind the tip comes no further than the end of the colon less
`s`, so its cell is as short as the tightest place on its way asks for.
"""

import math
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidOptionError

_SPLITS = 3
"""At most 2^3 splits or merges of a rod; engineering choice: beyond it rods are shorter than the scope is thick."""

_WINDOW = 1.0
"""Curvature is that over an arc of this many lumen diameters: what is shorter the scope bridges; engineering choice."""


def splits(mean_length: float, curvature_radius: float, diameter: float, largest_bend: float) -> int:
    """The paper's n: how many times a rod is halved (positive) or doubled (negative).

    Args:
        mean_length: mean length of the rods [m].
        curvature_radius: of the lumen's axis [m].
        diameter: of the lumen [m].
        largest_bend: of one joint [rad].
    """
    chord = (curvature_radius + diameter / 2) * math.sqrt(2 * (1 - math.cos(largest_bend)))
    return max(-_SPLITS, min(_SPLITS, math.ceil(math.log2(mean_length / chord) - 1e-12)))


def curvature_radii(
    points: Float[np.ndarray, "n 3"], arc: Float[np.ndarray, " n"], diameter: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Radius of curvature of a lumen's axis, smoothed over its own diameter [m]: arc over turn of the direction."""
    half = 0.5 * _WINDOW * diameter
    low, high = (np.clip(np.searchsorted(arc, arc + side * half), 0, len(arc) - 1) for side in (-1.0, 1.0))
    behind, ahead = points - points[low], points[high] - points
    lengths = np.linalg.norm(behind, axis=1) * np.linalg.norm(ahead, axis=1)
    cosine = np.einsum("ij,ij->i", behind, ahead) / np.maximum(lengths, 1e-12)
    turn = np.where(lengths > 0, np.arccos(np.clip(cosine, -1, 1)), 0.0)
    between = 0.5 * (arc[high] - arc[low])
    return between / np.maximum(turn, 1e-6)


def adaptive_spacing(
    points: Float[np.ndarray, "n 3"],
    arc: Float[np.ndarray, " n"],
    diameter: Float[np.ndarray, " n"],
    *,
    mean_length: float,
    largest_bend: float,
    shortest: float,
) -> Callable[[float], float]:
    """Cell length as a function of the distance from the tip, for a scope that may go all the way in.

    Args:
        points: the lumen's axis [m].
        arc: arc length along it [m].
        diameter: of the lumen [m].
        mean_length: length of a cell that is neither split nor merged [m].
        largest_bend: of one joint [rad].
        shortest: no cell is shorter [m]; the scope's diameter is a sound choice.

    Raises:
        InvalidOptionError: when a length or the bend is not positive, or the bend exceeds half a turn.
    """
    if not (mean_length > 0 and shortest > 0 and 0 < largest_bend <= math.pi):
        raise InvalidOptionError("Adaptive spacing needs positive lengths and a largest bend of at most 180 degrees.")
    radii = curvature_radii(points, arc, diameter)
    lengths = np.array(
        [
            mean_length / 2 ** splits(mean_length, float(radius), float(width), largest_bend)
            for radius, width in zip(radii, diameter, strict=True)
        ]
    )
    tightest = np.minimum.accumulate(np.maximum(lengths, shortest))

    def cell_length(from_tip: float) -> float:
        furthest = max(0.0, float(arc[-1]) - from_tip)
        return float(tightest[min(int(np.searchsorted(arc, furthest)), len(arc) - 1)])

    return cell_length
