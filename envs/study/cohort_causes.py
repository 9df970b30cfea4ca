"""Which of the patients' numbers move an observable: the cohort's own Latin hypercube, in thirds of each number."""

from dataclasses import dataclass

import numpy as np

from haustra.envs.study.cohort_table import Published
from haustra.envs.study.patients import Patient, patient_variables, traits
from haustra.envs.study.store import SweepStore

FEWEST = 12
"""Fewer patients than this tell nothing about what moves them."""
_NO_CAUSES = ("seed", "age")
"""Variables that are no cause: a seed is no quantity, and age changes nothing."""


@dataclass(frozen=True)
class Cause:
    """One number of patients, and what it does to one observable."""

    variable: str
    correlation: float
    """Rank correlation over patients."""
    low: float
    """Mean of patients in the lowest third of the number, or who have the trait."""
    high: float
    """Mean of patients in the highest third, or who have it not."""
    patients: int
    """How many patients tell it."""
    allowed: bool
    """Whether either third alone would be inside the band: whether a source allows a number that would do."""


def causes(store: SweepStore, about: Published, *, driver: str, device: str, most: int = 3) -> list[Cause]:
    """The numbers that move an observable most, strongest first; none of observables that no column gives."""
    if not about.column:
        return []
    sexes = {"men": "male", "women": "female"}
    pairs = [
        (job["variables"], float(job["scores"][about.column]))
        for job in store.rows()
        if job["state"] == "finished"
        and (job["conditions"]["driver"], job["conditions"]["device"]) == (driver, device)
        and job["scores"].get(about.column) is not None
        and (not about.over or job["scores"]["sex"] == sexes[about.over])
    ]
    if len(pairs) < FEWEST:
        return []
    values = np.array([value for _, value in pairs])
    found = []
    for variable in patient_variables():
        if variable.name in _NO_CAUSES:
            continue
        drawn = np.array([float(variables.get(variable.name, variable.nominal)) for variables, _ in pairs])
        low, high = np.quantile(drawn, [1 / 3, 2 / 3])
        is_below, is_above = drawn < low, drawn >= high
        if variable.name in traits():
            is_below = np.array([Patient.of(variables).has(variable.name) for variables, _ in pairs])
            is_above = ~is_below
        below, above = values[is_below], values[is_above]
        if not len(below) or not len(above) or np.ptp(values) == 0:
            continue
        means = float(below.mean()), float(above.mean())
        band = about.band or (-np.inf, np.inf)
        allowed = any(band[0] <= mean <= band[1] for mean in means)
        found.append(Cause(variable.name, _rank_correlation(drawn, values), *means, len(values), allowed))
    return sorted(found, key=lambda cause: -abs(cause.correlation))[:most]


def _rank_correlation(one: np.ndarray, other: np.ndarray) -> float:
    from scipy.stats import rankdata

    return float(np.corrcoef(rankdata(one), rankdata(other))[0, 1])
