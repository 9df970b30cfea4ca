"""What the inner wall looks like: pink, wet, with vessels. Appearance only; nothing here is a measurement."""

from functools import cache

import numpy as np
from jaxtyping import Float
from scipy.ndimage import map_coordinates

_PINK, _PALE, _VESSEL = np.array([0.90, 0.37, 0.31]), np.array([0.97, 0.54, 0.46]), np.array([0.60, 0.07, 0.06])
_PATCH, _VESSEL_WIDE, _VESSEL_FINE, _RIPPLE = 0.018, 0.014, 0.006, 0.0024
"""Lengths over which patches, vessels and the wet film's ripples vary [m]."""


def value_noise(points: Float[np.ndarray, "points 3"], scale: float, seed: int = 0) -> Float[np.ndarray, " points"]:
    """Smooth random field in 0 to 1 that varies over `scale` [m] and repeats after 32 times that."""
    cell = np.floor(points / scale)
    within = points / scale - cell
    smooth = cell + within**2 * (3 - 2 * within)
    return map_coordinates(_lattice(seed), smooth.T, order=1, mode="grid-wrap")


def colour(points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "points 3"]:
    """Colour of the mucosa under white light, RGB 0 to 1."""
    patch = value_noise(points, _PATCH)[:, None]
    base = _PINK * (1 - patch) + _PALE * patch
    # Vessels branch where a wandering field crosses its middle; the wide ones carry the fine ones with them.
    bend = np.stack([value_noise(points, 0.008, seed) for seed in (11, 12, 13)], axis=1) - 0.5
    wandering = points + 0.006 * bend
    wide = _ridge(value_noise(wandering, _VESSEL_WIDE, 1), 0.035)
    fine = _ridge(value_noise(wandering, _VESSEL_FINE, 2), 0.05)
    presence = np.clip(2.2 * value_noise(points, 0.03, 3) - 0.6, 0, 1)
    vessel = np.clip(0.55 * wide + 0.30 * fine, 0, 0.7) * presence
    return base * (1 - vessel[:, None]) + _VESSEL * vessel[:, None]


def ripple(points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, "points 3"]:
    """Unevenness of the wet surface, to be added to its unit normals."""
    return 2 * np.stack([value_noise(points, _RIPPLE, seed) for seed in (21, 22, 23)], axis=1) - 1.0


def _ridge(field: np.ndarray, width: float) -> np.ndarray:
    return np.exp(-(((field - 0.5) / width) ** 2))


@cache
def _lattice(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).random((32, 32, 32))
