"""One case: what is drawn from the published distributions before a colon is grown."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache

import numpy as np

from haustra.assets import asset
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.quantity import Quantity, load_quantities

SEGMENT_SPREAD = 0.06
"""Standard deviation of a segment's length and diameter about the person's own mean, as a share of it."""


@dataclass(frozen=True)
class ColonRecipe:
    """Lengths, diameters and folds of one person's colon."""

    lengths: Mapping[str, float]
    """Length of each segment [m]."""
    diameters: Mapping[str, float]
    """Mean effective diameter of each segment [m]."""
    fold_spacings: Mapping[str, float]
    """Mean distance between folds of each segment [m]."""
    fold_heights: Mapping[str, float]
    """Height of a fold over the haustrum beside it, as a share of the radius [1]."""
    anus_diameter: float
    """Diameter of the open anal canal [m]."""
    taeniae: int
    """Number of taeniae [1]."""
    taenia_width: float
    """Width of each taenia [m]."""
    flexure_radius: float
    """Smallest radius of curvature of the axis [m]."""
    gap: float
    """Room between the lumens of neighbouring loops [m]."""

    @property
    def length(self) -> float:
        """Length from anus to caecum [m]."""
        return sum(self.lengths.values())

    def borders(self) -> dict[str, tuple[float, float]]:
        """Start and end of each segment [m] from the anus."""
        ends = np.cumsum([self.lengths[name] for name in SEGMENTS]).tolist()
        return dict(zip(SEGMENTS, zip([0.0, *ends[:-1]], ends, strict=True), strict=True))

    def to_json(self) -> dict:
        """As plain JSON values."""
        return asdict(self)


@cache
def priors() -> Mapping[str, Quantity]:
    """The sourced numbers of assets/numbers/anatomy.toml, without their common prefix."""
    return {name.removeprefix("anatomy."): q for name, q in load_quantities(asset("numbers/anatomy.toml")).items()}


def draw_recipe(rng: np.random.Generator) -> ColonRecipe:
    """Draw one adult, insufflated colon.

    The whole length is normal within its range, the sigmoid log-normal; the other segments share what remains in
    their usual proportions, the rectum apart. One factor a person scales all diameters.
    """
    known = priors()
    lengths = _draw_lengths(rng, known)
    width = np.clip(1 + known["diameter.spread"].value * rng.standard_normal(), 0.7, 1.3)
    diameters = {
        name: _within(known[f"diameter.{name}"], known[f"diameter.{name}"].value * width * _spread(rng))
        for name in SEGMENTS
    }
    return ColonRecipe(
        lengths=lengths,
        diameters=diameters,
        fold_spacings={name: known[f"fold_spacing.{name}"].value * _spread(rng) for name in SEGMENTS},
        fold_heights={name: known[f"fold_height.{name}"].value * _spread(rng) for name in SEGMENTS},
        anus_diameter=known["diameter.anus"].value,
        taeniae=int(known["taenia.count"].value),
        taenia_width=known["taenia.width"].value,
        flexure_radius=known["flexure.radius"].value,
        gap=known["gap"].value,
    )


def _draw_lengths(rng: np.random.Generator, known: Mapping[str, Quantity]) -> dict[str, float]:
    total = known["length.total"]
    whole = _within(total, total.value + known["length.total_sd"].value * rng.standard_normal())
    variation = float(np.log1p(known["length.sigmoid_cv"].value ** 2))
    lengths = {name: known[f"length.{name}"].value * _spread(rng) for name in SEGMENTS}
    sigmoid = known["length.sigmoid"].value * np.exp(np.sqrt(variation) * rng.standard_normal() - variation / 2)
    lengths["sigmoid"] = _within(known["length.sigmoid"], float(sigmoid))
    rest = (whole - lengths["rectum"]) / (sum(lengths.values()) - lengths["rectum"])
    return {name: float(value if name == "rectum" else value * rest) for name, value in lengths.items()}


def _spread(rng: np.random.Generator) -> float:
    return float(1 + SEGMENT_SPREAD * np.clip(rng.standard_normal(), -2, 2))


def _within(quantity: Quantity, value: float) -> float:
    return float(np.clip(value, quantity.low, quantity.high))
