"""Patients that devices are compared in: held-out grown colons, each with friction and wall stiffness of its own."""

from dataclasses import dataclass
from functools import lru_cache

from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon

COHORTS = {"smoke": 2, "quick": 4, "standard": 20, "large": 100}
"""Names of cohorts, and how many patients each has; a larger one begins with other patients."""
FIRST_SEED = 400_000
"""First seed of the colons, which nothing was trained on."""
FRICTION = (0.03, 0.1)
"""Coulomb's coefficient between device and wall [1]: from a wetted bowel to `contact.friction`."""
WALL_STIFFNESS = (700.0, 2400.0)
"""Stiffness of a contact with the wall, as measured (Johnson 2019) [N/m]."""


@dataclass(frozen=True)
class Patient:
    """One patient."""

    name: str
    """Cohort and number, as in 'quick-0'."""
    seed: int
    """Seed of the grown colon."""
    friction: float
    """Coulomb's coefficient between device and wall [1]."""
    wall_stiffness: float
    """Stiffness of a contact with the wall [N/m]."""

    @property
    def colon(self) -> Colon:
        """Their colon."""
        return _grown(self.seed)


def patients(cohort: str) -> tuple[Patient, ...]:
    """The patients of a cohort: a Latin hypercube over friction and wall stiffness, one grown colon each.

    Raises:
        InvalidOptionError: when there is no cohort of that name.
    """
    from scipy.stats import qmc

    if cohort not in COHORTS:
        raise InvalidOptionError(f"Cohort '{cohort}' is not known. Known: {', '.join(COHORTS)}.")
    count = COHORTS[cohort]
    shares = qmc.LatinHypercube(2, rng=count).random(count)
    drawn = qmc.scale(shares, *zip(FRICTION, WALL_STIFFNESS, strict=True))
    return tuple(
        Patient(f"{cohort}-{number}", FIRST_SEED + 1000 * count + number, float(friction), float(stiffness))
        for number, (friction, stiffness) in enumerate(drawn)
    )


def patient_named(name: str) -> Patient:
    """The patient of that name.

    Raises:
        InvalidOptionError: when there is none.
    """
    cohort, _, number = name.rpartition("-")
    known = patients(cohort)
    if not (number.isascii() and number.isdecimal() and int(number) < len(known)):
        raise InvalidOptionError(f"Patient '{name}' is not known: give {cohort}-0 to {cohort}-{len(known) - 1}.")
    return known[int(number)]


@lru_cache(maxsize=8)
def _grown(seed: int) -> Colon:
    return grow_colon(seed=seed)
