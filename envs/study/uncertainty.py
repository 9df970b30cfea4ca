"""What the uncertainty of a comparison is made of: numerical, parameter, between patients, driver.

Two scopes are compared in the same colons, with the same numbers: the quantity of interest is the mean difference,
first less second, over pairs of insertions with equal caecal intubation. Colons and draws of the assumed numbers are
crossed, so that a two-way analysis of variance (method of moments) tells spread between patients from that of
parameters; the rest is their interaction, chance included. Drivers are told apart by the mean difference of each, and
the numerical part by running one draw of every colon with half the time step.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.children import cores
from haustra.envs.learning.statistics import mean_interval
from haustra.envs.study.credibility import Comparison
from haustra.envs.study.run import Computing, run_sweep
from haustra.envs.study.sampling import at_quantiles
from haustra.envs.study.store import read_store
from haustra.envs.study.study import Sampler, Study
from haustra.errors import InvalidStudyError

LEAST_PAIRS = 4
"""Fewer pairs tell of no spread; engineering choice."""
_REACHED = "caecum"
"""Score that must be equal in a pair."""


@dataclass(frozen=True)
class Uncertainty:
    """A comparison's result and what it is uncertain by, in the score's unit; None where that was not measured."""

    effect: float
    """Mean difference, first scope less second, by the first driver."""
    low: float
    """Lower end of its 95 % interval, over patients (bootstrap)."""
    high: float
    """Upper end."""
    first: float
    """Mean of the first scope over the same pairs: of each patient's mean, as the effect is."""
    second: float
    """Mean of the second scope."""
    pairs: int
    """Number of pairs that were compared."""
    left_out: int
    """Number of pairs with unequal caecal intubation, or with an insertion that diverged or failed."""
    reached: float
    """Share of the pairs compared in which both came to the caecum [1]."""
    patients: float | None
    """Standard deviation between patients."""
    parameters: float | None
    """Standard deviation between draws of the assumed numbers."""
    rest: float | None
    """Standard deviation of what neither explains."""
    numerical: float | None
    """Root mean square change of a pair's difference when the time step is halved."""
    drivers: Mapping[str, float | None]
    """Mean difference by each driver."""

    @property
    def driver(self) -> float | None:
        """Standard deviation between drivers."""
        known = [value for value in self.drivers.values() if value is not None]
        return float(np.std(known, ddof=1)) if len(known) > 1 else None

    @property
    def resolved(self) -> bool:
        """Whether the interval is on one side of zero, and every driver's mean on the same."""
        signs = {np.sign(value) for value in (self.low, self.high, *self.drivers.values()) if value is not None}
        return len(signs) == 1 and 0.0 not in signs


def run_comparison(
    asked: Comparison,
    folder: Path,
    *,
    backend: str = "linear",
    resume: bool = False,
    progress: Callable[[int, int, str], None] = lambda done, total, note: None,
) -> Uncertainty:
    """Run what is missing of a comparison's two studies, and say what its result is uncertain by.

    Args:
        asked: what is compared.
        folder: for the stores 'runs' and 'runs-half-step'.
        backend: what steps them: linear, or linear-gpu.
        resume: go on with stores that are there.
        progress: told how many jobs are done, of how many.

    Raises:
        InvalidStudyError: when the score or a variable is not known, or too few pairs are left.
        InvalidOptionError: when the folder holds another comparison.
    """
    whole = comparison_study(asked)
    half = comparison_study(asked, half_step=True)
    rows = {}
    for name, study in (("runs", whole), ("runs-half-step", half)):
        run_sweep(
            study,
            folder / name,
            Computing(backend=backend, workers=cores()),
            resume=resume,
            tables=False,
            progress=progress,
        )
        rows[name] = rows_of(folder / name)
    return split(asked, rows["runs"], rows["runs-half-step"])


def comparison_study(asked: Comparison, *, half_step: bool = False) -> Study:
    """The study that crosses colons with draws of the assumed numbers, or one draw of each with half the time step.

    Raises:
        InvalidStudyError: when the score or a variable is not known.
    """
    from scipy.stats import qmc

    from haustra.envs.study.cohort import SCORES, CohortOptions, check
    from haustra.envs.study.patients import patient_variables

    variables = patient_variables()
    known = [variable.name for variable in variables]
    for name in asked.measured:
        if name not in known:
            raise InvalidStudyError(f"comparison.measured: '{name}' is not known. Known: {', '.join(known)}.")
    if asked.score not in [column.name for column in SCORES if column.unit != "text"]:
        raise InvalidStudyError(f"comparison.score: '{asked.score}' is no number that a cohort's study has.")
    parameters = 1 if half_step else asked.parameters

    def drawn(count: int, seed: int) -> list[dict[str, float]]:
        return at_quantiles(variables, qmc.LatinHypercube(len(variables), rng=seed).random(count))

    people, numbers = drawn(asked.patients, asked.seed), drawn(asked.parameters, asked.seed + 1)
    designs = tuple(
        {
            "name": f"{patient}-{draw}",
            **{name: (people[patient] if name in asked.measured else numbers[draw])[name] for name in known},
        }
        for patient in range(asked.patients)
        for draw in range(parameters)
    )
    study = Study(
        question="cohort",
        title="Two scopes in the same colons" + (", half the time step" if half_step else ""),
        base="default",
        variables=variables,
        conditions={"driver": asked.drivers[:1] if half_step else asked.drivers, "device": asked.devices},
        objectives=(),
        sampler=Sampler(kind="list", designs=designs),
        options={"seconds": asked.seconds, "timestep": CohortOptions().timestep / (2 if half_step else 1)},
    )
    for driver in asked.drivers:
        for device in asked.devices:
            check(study, {}, {"driver": driver, "device": device})
    return study


def rows_of(folder: Path) -> list[dict[str, Any]]:
    """Rows of a store of `comparison_study`: patient, draw, driver, device and the scores of a finished job."""
    with read_store(folder) as store:
        names = [str(design["name"]).split("-") for design in store.study.sampler.designs]
        return [
            {
                "patient": int(names[row["design"]][0]),
                "draw": int(names[row["design"]][1]),
                "driver": row["conditions"]["driver"],
                "device": row["conditions"]["device"],
                "scores": row["scores"] if row["state"] == "finished" else None,
            }
            for row in store.rows()
        ]


def split(asked: Comparison, rows: Sequence[Mapping[str, Any]], half: Sequence[Mapping[str, Any]]) -> Uncertainty:
    """What rows of both studies say.

    Raises:
        InvalidStudyError: when fewer than `LEAST_PAIRS` pairs are left.
    """
    shape = (asked.patients, asked.parameters)
    by_driver = {driver: _pairs(asked, rows, driver, shape) for driver in asked.drivers}
    main = by_driver[asked.drivers[0]]
    difference = main[0] - main[1]
    there = np.isfinite(difference)
    if there.sum() < LEAST_PAIRS:
        raise InvalidStudyError(
            f"Only {int(there.sum())} of {there.size} pairs have equal caecal intubation: ask for more patients."
        )
    low, high = mean_interval(_rows(difference), seed=asked.seed)
    patients, parameters, rest = _components(difference)
    finer = _pairs(asked, half, asked.drivers[0], (asked.patients, 1))
    change = (finer[0] - finer[1])[:, 0] - difference[:, 0]
    change = change[np.isfinite(change)]
    return Uncertainty(
        effect=_mean_of_patients(difference),
        low=low,
        high=high,
        first=_mean_of_patients(main[0]),
        second=_mean_of_patients(main[1]),
        pairs=int(there.sum()),
        left_out=int((~there).sum()),
        reached=float(main[2][there].mean()),
        patients=patients,
        parameters=parameters,
        rest=rest,
        numerical=float(np.sqrt((change**2).mean())) if len(change) else None,
        drivers={
            driver: _mean_of_patients(each[0] - each[1]) if np.isfinite(each[0] - each[1]).any() else None
            for driver, each in by_driver.items()
        },
    )


def _pairs(
    asked: Comparison, rows: Sequence[Mapping[str, Any]], driver: str, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scores of both scopes in pairs that came equally far, else NaN; and whether the first was at the caecum."""
    scores, reached = np.full((2, *shape), np.nan), np.full((2, *shape), np.nan)
    for row in rows:
        if row["driver"] == driver and row["scores"] is not None and row["scores"].get(asked.score) is not None:
            place = asked.devices.index(row["device"]), row["patient"], row["draw"]
            scores[place], reached[place] = row["scores"][asked.score], row["scores"][_REACHED]
    equal = (reached[0] == reached[1]) & np.isfinite(scores).all(axis=0)
    return np.where(equal, scores[0], np.nan), np.where(equal, scores[1], np.nan), reached[0]


def _mean_of_patients(difference: Float[np.ndarray, "patients draws"]) -> float:
    """Mean over patients of each one's mean."""
    return float(np.mean(_rows(difference)))


def _rows(difference: np.ndarray) -> np.ndarray:
    """Mean of each patient who has any pair."""
    return np.array([row[np.isfinite(row)].mean() for row in difference if np.isfinite(row).any()])


def _components(difference: np.ndarray) -> tuple[float | None, float | None, float | None]:
    """Standard deviations between rows, between columns and of the rest, of rows and columns without gaps."""
    kept = difference[np.isfinite(difference).all(axis=1)]
    patients, draws = kept.shape
    if patients < 2:
        return None, None, None
    rows, columns = kept.mean(axis=1), kept.mean(axis=0)
    if draws < 2:
        return float(rows.std(ddof=1)), None, None
    rest = kept - rows[:, None] - columns + kept.mean()
    chance = float((rest**2).sum()) / ((patients - 1) * (draws - 1))
    between = max(float(rows.var(ddof=1)) - chance / draws, 0.0)
    drawn = max(float(columns.var(ddof=1)) - chance / patients, 0.0)
    return between**0.5, drawn**0.5, chance**0.5
