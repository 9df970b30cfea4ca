"""The wall of a grown colon about its axis: haustra between taeniae, parted by semilunar folds."""

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from haustra.models.anatomy.course import radius_along
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.anatomy.recipe import ColonRecipe

FOLD_SHARPNESS = 3.0
"""Power of the arch between folds: 2 is a round vault, larger is a flat one with narrower folds."""
FOLD_JITTER = 0.15
"""Standard deviation of the distance between folds, as a share of it."""
FOLD_STAGGER = 0.15
"""Standard deviation by which neighbouring rows of folds miss each other, as a share of the distance of folds."""
FOLD_DIP = 0.6
"""Share of a fold's height that stands inside the line of the taeniae."""
SMOOTH_ENDS = 0.02
"""Folds fade out over this length [m] at the anus."""


def haustral_radius(
    recipe: ColonRecipe, rng: np.random.Generator, arc: Float[np.ndarray, " rings"], angles: int
) -> Float[np.ndarray, "rings angles"]:
    """Radius of the lumen [m] on rings at the given arc lengths, at angle 2*pi*k/angles.

    Between two taeniae each haustrum bulges, highest midway; folds dip inside the line of the taeniae. Every
    cross-section has the area of a circle of the mean radius there.
    """
    mean = radius_along(recipe, arc)
    height = _between_middles(recipe, recipe.fold_heights, arc)
    height = height * np.clip(arc / SMOOTH_ENDS - 0.5, 0.0, 1.0)
    turn = 2 * np.pi * np.arange(angles) / angles
    sector = np.floor(turn / (2 * np.pi) * recipe.taeniae).astype(int)
    across = turn / (2 * np.pi) * recipe.taeniae - sector
    flat = recipe.taeniae * recipe.taenia_width / (2 * np.pi * mean)  # share of a sector that its taenia takes
    inner = np.clip((np.abs(across - 0.5)[None, :] * 2) / (1 - np.clip(flat, 0, 0.5))[:, None], 0, 1)
    bulge = np.cos(np.pi / 2 * inner) ** 2
    vault = _vaults(recipe, rng, arc)
    shape = 1 + height[:, None] * bulge * (vault[:, sector] - FOLD_DIP)
    # One fold narrows its section and a haustrum widens it: only the average over a few folds is held to the mean.
    return mean[:, None] * shape / np.sqrt((shape**2).mean())


def _vaults(recipe: ColonRecipe, rng: np.random.Generator, arc: np.ndarray) -> Float[np.ndarray, "rings sectors"]:
    """0 on a fold, 1 midway between two, for each row between two taeniae; the rows' folds nearly meet."""
    spacing = _between_middles(recipe, recipe.fold_spacings, np.arange(0, recipe.length, 1e-3))
    folds = [-float(rng.uniform(0, spacing[0]))]
    while folds[-1] < recipe.length + spacing[-1]:
        here = spacing[min(max(int(folds[-1] * 1e3), 0), len(spacing) - 1)]
        folds.append(folds[-1] + float(here * (1 + FOLD_JITTER * np.clip(rng.standard_normal(), -2, 2))))
    rows = []
    for _ in range(recipe.taeniae):
        shift = FOLD_STAGGER * float(spacing.mean()) * np.clip(rng.standard_normal(len(folds)), -1.5, 1.5)
        row = np.array(folds) + shift
        nth = np.clip(np.searchsorted(row, arc, side="right") - 1, 0, len(row) - 2)
        rows.append(1 - np.abs(np.clip(2 * (arc - row[nth]) / (row[nth + 1] - row[nth]) - 1, -1, 1)) ** FOLD_SHARPNESS)
    return np.stack(rows, axis=1)


def _between_middles(recipe: ColonRecipe, values, arc: np.ndarray) -> np.ndarray:
    """A segment's value at its middle, changing smoothly to the next."""
    middles = [sum(recipe.borders()[name]) / 2 for name in SEGMENTS]
    inside = np.clip(arc, middles[0], middles[-1])
    return PchipInterpolator(middles, [values[name] for name in SEGMENTS])(inside)
