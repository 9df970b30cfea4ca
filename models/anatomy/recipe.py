"""One case: what is drawn from the published distributions before a colon is grown."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from scipy.special import ndtri

from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.anatomy.person import Person, priors, tidy, truncated
from haustra.quantity import Quantity

SEGMENT_SPREAD = 0.05
"""Standard deviation of a segment's length and diameter about the person's own mean, as a share of it."""
SPREAD_LIMIT = 2.0
"""Standard deviations at which that spread ends."""
WIDENINGS, WIDENING_WAVES = 4, (0.06, 0.30)
"""Waves of the diameter along the colon, and the range of their lengths [m]."""
ELASTICITY = {"descending": 0.5, "transverse": 0.8, "ascending": 0.5, "caecum": 0.5}
"""Power of the person's whole length over the mean with which a segment's length goes; the sigmoid takes what is left
and so explains most of the variance (Phillips 2015, doi 10.1308/003588415X14181254790527). An engineering choice that
keeps descending and ascending colon within their published ranges."""


@dataclass(frozen=True)
class ColonRecipe:
    """Lengths, diameters and folds of one person's colon."""

    person: Person
    """Cohort, sex and tortuosity."""
    lengths: Mapping[str, float]
    """Length of each segment [m]."""
    diameters: Mapping[str, float]
    """Mean effective diameter of each segment [m]."""
    widenings: tuple[tuple[float, float, float], ...]
    """Slow waves of the diameter along the colon: amplitude as a share of it [1], wavelength [m], phase [rad]."""
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
    flexures: float
    """Acute flexures that the course aims at [1]."""
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


def draw_recipe(rng: np.random.Generator, person: Person) -> ColonRecipe:
    """Draw one adult, insufflated colon of this person.

    One factor a person scales all diameters; flexures go with the length and with the person's tortuosity.
    """
    known = priors()
    distension = known["diameter.distension"]
    sd = known["diameter.spread"].value
    width = distension.value + sd * truncated(
        rng.random(), (distension.low - distension.value) / sd, (distension.high - distension.value) / sd
    )
    return ColonRecipe(
        person=person,
        lengths=_draw_lengths(rng, person, known),
        diameters={name: _about(rng, known[f"diameter.{name}"], width) for name in SEGMENTS},
        widenings=_draw_widenings(rng, known["diameter.along"].value),
        fold_spacings={name: _about(rng, known[f"fold_spacing.{name}"]) for name in SEGMENTS},
        fold_heights={name: _about(rng, known[f"fold_height.{name}"]) for name in SEGMENTS},
        anus_diameter=known["diameter.anus"].value,
        taeniae=int(known["taenia.count"].value),
        taenia_width=known["taenia.width"].value,
        flexures=tidy(_flexures(person, known)),
        flexure_radius=tidy(_flexure_radius(person, known["flexure.radius"], known["flexure.radius_fall"].value)),
        gap=known["gap"].value,
    )


def _draw_lengths(rng: np.random.Generator, person: Person, known: Mapping[str, Quantity]) -> dict[str, float]:
    """Every segment but the sigmoid about its usual length, within its range; the sigmoid takes what is left."""
    longer = _cohort_mean(known, person.cohort) / known["length.reference"].value
    stretch = person.length / person.length_mean
    lengths = {"rectum": _about(rng, known["length.rectum"])}
    for name, power in ELASTICITY.items():
        usual = known[f"length.{name}_{person.sex}" if name == "transverse" else f"length.{name}"]
        lengths[name] = longer * _about(rng, usual, stretch**power)
    sigmoid = known["length.sigmoid"]
    rest = sum(lengths.values())
    lengths["sigmoid"] = float(np.clip(person.length - rest, longer * sigmoid.low, longer * sigmoid.high))
    lengths["transverse"] += person.length - rest - lengths["sigmoid"]  # only in very short and very long colons
    return {name: tidy(lengths[name]) for name in SEGMENTS}


def _draw_widenings(rng: np.random.Generator, sd: float) -> tuple[tuple[float, float, float], ...]:
    waves = WIDENING_WAVES[0] * (WIDENING_WAVES[1] / WIDENING_WAVES[0]) ** rng.random(WIDENINGS)
    phases = 2 * np.pi * rng.random(WIDENINGS)
    amplitude = tidy(sd * np.sqrt(2 / WIDENINGS))
    return tuple((amplitude, tidy(wave), tidy(phase)) for wave, phase in zip(waves, phases, strict=True))


def _flexures(person: Person, known: Mapping[str, Quantity]) -> float:
    """Khashab's number per metre, and of its variance what the length does not explain by the tortuosity."""
    per_metre = known["tortuosity.flexures"].value / _cohort_mean(known, "us-ctc")
    by_length = per_metre * known["cohort.us-ctc.female_sd"].value
    total = known["tortuosity.flexures_sd"].value
    share = known["tortuosity.length_correlation"].value
    # (by_length + x * twist)^2 with correlated length and twist has the variance total^2.
    twist = -share * by_length + np.sqrt(total**2 - (1 - share**2) * by_length**2)
    return float(per_metre * person.length + twist * person.tortuosity)


def _cohort_mean(known: Mapping[str, Quantity], cohort: str) -> float:
    women = known[f"cohort.{cohort}.female_share"].value
    return women * known[f"cohort.{cohort}.female"].value + (1 - women) * known[f"cohort.{cohort}.male"].value


def _flexure_radius(person: Person, usual: Quantity, fall: float) -> float:
    return float(np.clip(usual.value * np.exp(-fall * person.tortuosity), usual.low, usual.high))


def _about(rng: np.random.Generator, quantity: Quantity, factor: float = 1.0) -> float:
    """About `factor` times the usual value, within its range."""
    spread = SEGMENT_SPREAD * np.clip(ndtri(rng.random()), -SPREAD_LIMIT, SPREAD_LIMIT)
    return tidy(np.clip(quantity.value * factor * (1 + spread), quantity.low, quantity.high))
