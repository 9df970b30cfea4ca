"""Whose colon is grown: cohort, sex and difficulty, as a continuum of tortuosity cut into named bands."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import ndtr, ndtri

from haustra.assets import asset
from haustra.errors import InvalidOptionError
from haustra.quantity import Quantity, load_quantities

COHORTS = ("japan-ctc", "us-ctc")
"""Whose lengths: Utano 2021 or Khashab 2009, both by CT colonography."""
SEXES = ("any", "female", "male")
"""`any` draws it by the cohort's share."""
DIFFICULTIES = ("any", "easy", "moderate", "difficult", "hard")
"""Bands of tortuosity; `any` draws from all of it."""
EASY_BELOW = -0.5
"""Easy is the third of all people below this tortuosity: an engineering choice."""
HARD_OVER_DIFFICULT = 1.0
"""Hard begins this many standard deviations above difficult: one woman in fifteen, one man in forty."""


@dataclass(frozen=True)
class Person:
    """What is known of a person before the colon is drawn."""

    cohort: str
    """Whose length distribution."""
    sex: str
    """female or male."""
    difficulty: str
    """easy, moderate, difficult or hard."""
    tortuosity: float
    """In standard deviations of one sex, from the middle between the two [1]."""
    length: float
    """Whole length [m]."""
    length_mean: float
    """Mean of the cohort's sex [m]."""


@cache
def priors() -> Mapping[str, Quantity]:
    """The sourced numbers of assets/numbers/anatomy.toml, without their common prefix."""
    return {name.removeprefix("anatomy."): q for name, q in load_quantities(asset("numbers/anatomy.toml")).items()}


def draw_person(
    rng: np.random.Generator, *, cohort: str = "japan-ctc", sex: str = "any", difficulty: str = "any"
) -> Person:
    """Draw a person; the same draws serve every option, so that options change only what they name.

    Source: Saunders 1996, GIE 43:124: colonoscopy is judged difficult in 31 % of women and 16 % of men. Two unit
    normals half a standard deviation apart exceed one threshold by these shares. Long colons tend to be tortuous.

    Raises:
        InvalidOptionError: when an option is not known.
    """
    for name, value, known in (
        ("Cohort", cohort, COHORTS),
        ("Sex", sex, SEXES),
        ("Difficulty", difficulty, DIFFICULTIES),
    ):
        if value not in known:
            raise InvalidOptionError(f"{name} '{value}' is not known. Known: {', '.join(known)}.")
    numbers = priors()
    coin, twist, own = rng.random(3)
    if sex == "any":
        sex = "female" if coin < numbers[f"cohort.{cohort}.female_share"].value else "male"
    middle = (0.5 if sex == "female" else -0.5) * numbers["tortuosity.sex_shift"].value
    low, high = _band(difficulty)
    within_sex = truncated(twist, low - middle, high - middle)
    share = numbers["tortuosity.length_correlation"].value
    standing = share * within_sex + np.sqrt(1 - share**2) * float(ndtri(own))
    mean, spread = numbers[f"cohort.{cohort}.{sex}"], numbers[f"cohort.{cohort}.{sex}_sd"].value
    stretch = truncated(float(ndtr(standing)), (mean.low - mean.value) / spread, (mean.high - mean.value) / spread)
    tortuosity = middle + within_sex
    return Person(
        cohort=cohort,
        sex=sex,
        difficulty=name_difficulty(tortuosity),
        tortuosity=tidy(tortuosity),
        length=tidy(mean.value + spread * stretch),
        length_mean=mean.value,
    )


def name_difficulty(tortuosity: float) -> str:
    """The band in which a tortuosity lies."""
    return next(name for name in DIFFICULTIES[1:] if tortuosity <= _band(name)[1])


def truncated(share: float, low: float, high: float) -> float:
    """The unit normal's quantile at `share` of what lies between `low` and `high`."""
    return float(ndtri(ndtr(low) + share * (ndtr(high) - ndtr(low))))


def tidy(value: float) -> float:
    """Rounded to 1e-6, so that the last bits of another machine's logarithms do not show."""
    return round(float(value), 6)


def _band(difficulty: str) -> tuple[float, float]:
    difficult = priors()["tortuosity.difficult_threshold"].value
    hard = difficult + HARD_OVER_DIFFICULT
    return {
        "any": (-np.inf, np.inf),
        "easy": (-np.inf, EASY_BELOW),
        "moderate": (EASY_BELOW, difficult),
        "difficult": (difficult, hard),
        "hard": (hard, np.inf),
    }[difficulty]
