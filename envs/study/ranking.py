"""Which designs are best, how sure that is, and what each variable does.

Two designs are told apart in a score when their mean difference, condition by condition, exceeds both its 95 % interval
over the conditions and the numerical error of the score, where that was measured. Those that no objective tells apart
share a rank.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.study.questions import find_question
from haustra.envs.study.sampling import conditions_of, design_names
from haustra.envs.study.study import Objective, ScoreError, Study

if TYPE_CHECKING:
    import polars

CONFIDENCE = 0.95
RESAMPLES = 4000
"""Samples of a bootstrap: a bound's own scatter is then a few hundredths of the interval."""
_MANY = 200
"""Values from which on a mean is taken as normal: a bootstrap's bounds then differ by less than their own scatter."""
_BINS = 8
"""Into which a variable that is not on a grid is cut for its effect."""


@dataclass(frozen=True)
class Interval:
    """A mean and where it lies with 95 % confidence; without bounds for a single value."""

    mean: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class DesignTable:
    """One score of every design under every set of conditions; NaN where a job has no numbers."""

    study: Study
    designs: Int[np.ndarray, " designs"]
    """Their numbers."""
    names: tuple[str, ...]
    """What a person calls them."""
    variables: Mapping[str, Float[np.ndarray, " designs"]]
    """By column."""
    scores: Mapping[str, Float[np.ndarray, "designs conditions"]]
    """By column; only numbers."""
    errors: Mapping[str, ScoreError] = field(default_factory=dict)
    """Numerical errors by column, where they were measured."""

    @property
    def complete(self) -> Bool[np.ndarray, " designs"]:
        """Which designs finished under every set of conditions, with every objective."""
        wanted = [self.scores[objective.score] for objective in self.study.objectives] or list(self.scores.values())[:1]
        return np.all([np.isfinite(values).all(1) for values in wanted], axis=0)

    def means(self, score: str) -> Float[np.ndarray, " designs"]:
        """Mean of a score over the conditions; NaN unless all are there."""
        return self.scores[score].mean(1)

    def told_apart(self, score: str, one: int, others: Int[np.ndarray, " others"]) -> Bool[np.ndarray, " others"]:
        """Which other designs surely differ from one in a score, all by their places in the table."""
        values = self.scores[score]
        differences = values[others] - values[one]
        conditions = values.shape[1]
        scatter = differences.std(axis=1, ddof=1) if conditions > 1 else np.zeros(len(others))
        larger = np.maximum(np.abs(values[others].mean(1)), abs(values[one].mean()))
        error = self.errors.get(score, ScoreError())
        bound = np.maximum(_normal_quantile() * scatter / np.sqrt(conditions), error.relative * larger + error.absolute)
        return np.abs(differences.mean(1)) > bound


def design_table(
    frame: "polars.DataFrame",
    study: Study,
    scores: Sequence[str],
    *,
    errors: Mapping[str, ScoreError] | None = None,
) -> DesignTable:
    """Results by design; `scores` are columns of numbers, `errors` their numerical errors."""
    count = len(conditions_of(study))
    designs = np.unique(frame["design"].to_numpy())
    rows = np.searchsorted(designs, frame["design"].to_numpy())
    columns = frame["job"].to_numpy() % count
    found = {name: np.full((len(designs), count), np.nan) for name in scores}
    for name, values in found.items():
        values[rows, columns] = frame[name].cast(float).fill_null(float("nan")).to_numpy()
    first = np.unique(frame["design"].to_numpy(), return_index=True)[1]
    names = design_names(study)
    return DesignTable(
        study=study,
        designs=designs,
        names=tuple(names.get(int(number), f"design {number}") for number in designs),
        variables={
            variable.column: frame[variable.column].cast(float).to_numpy()[first] for variable in study.variables
        },
        scores=found,
        errors=errors or {},
    )


def errors_of(study: Study, sessions: Sequence[Mapping]) -> Mapping[str, ScoreError]:
    """Numerical errors of a study's scores; none where several backends computed it."""
    backends = {str(session["backend"]) for session in sessions}
    return find_question(study.question).errors(study, backends.pop()) if len(backends) == 1 else {}


def _normal_quantile() -> float:
    from scipy.stats import norm

    return float(norm.ppf((1 + CONFIDENCE) / 2))


def interval(values: Float[np.ndarray, " n"]) -> Interval:
    """Mean with its confidence by percentile bootstrap (Efron & Tibshirani 1993, chapter 13); repeatable.

    Many values, whose mean is normal by the central limit theorem, are not resampled.
    """
    low = high = None
    if len(values) >= _MANY:
        half = float(_normal_quantile() * values.std(ddof=1) / np.sqrt(len(values)))
        low, high = float(values.mean()) - half, float(values.mean()) + half
    elif len(values) > 1 and np.ptp(values) > 0:
        from scipy.stats import bootstrap

        found = bootstrap(
            (values,), np.mean, confidence_level=CONFIDENCE, n_resamples=RESAMPLES, method="percentile", rng=0
        ).confidence_interval
        low, high = float(found.low), float(found.high)
    elif len(values) > 1:
        low = high = float(values[0])
    return Interval(float(values.mean()), low, high)


def pareto_front(means: Float[np.ndarray, "designs objectives"]) -> Bool[np.ndarray, " designs"]:
    """Which designs no other beats in one objective without losing in another; all objectives are minimised."""
    front = np.ones(len(means), bool)
    for index, point in enumerate(means):
        if front[index]:
            beaten = (means >= point).all(1) & (means > point).any(1)
            front[beaten] = False
    return front


def to_minimise(table: DesignTable, objectives: Sequence[Objective]) -> Float[np.ndarray, "designs objectives"]:
    """Means of the objectives, those to maximise with the other sign."""
    return np.stack([table.means(o.score) * (-1 if o.goal == "maximise" else 1) for o in objectives], axis=1)


@dataclass(frozen=True)
class Ranking:
    """Complete designs, best first."""

    places: Int[np.ndarray, " ranked"]
    """In the table."""
    front: Bool[np.ndarray, " ranked"]
    """On the Pareto front, or not told apart from one that is."""
    ranks: Int[np.ndarray, " ranked"]
    """From 1; those that are not told apart from the first of them share a rank, which the next is higher by their
    number."""


def ranked(table: DesignTable) -> Ranking:
    """First the Pareto front, then the others; within each by the mean of ranks in the objectives: no weights needed.

    Designs that are not told apart stand together under one rank.
    """
    places = np.flatnonzero(table.complete)
    if not len(places) or not table.study.objectives:
        return Ranking(places, np.zeros(len(places), bool), np.arange(1, len(places) + 1))
    from scipy.stats import rankdata

    values = to_minimise(table, table.study.objectives)[places]
    front = pareto_front(values)
    for place in places[front]:
        front |= ~_differ(table, int(place), places)
    left = np.lexsort((places, rankdata(values, axis=0).mean(1), ~front))
    order: list[int] = []
    ranks: list[int] = []
    while len(left):
        same = ~_differ(table, int(places[left[0]]), places[left])
        ranks += [len(order) + 1] * int(same.sum())
        order += left[same].tolist()
        left = left[~same]
    return Ranking(places[order], front[order], np.array(ranks))


def _differ(table: DesignTable, one: int, others: Int[np.ndarray, " others"]) -> Bool[np.ndarray, " others"]:
    """Which others some objective tells apart from one design."""
    return np.any([table.told_apart(objective.score, one, others) for objective in table.study.objectives], axis=0)


@dataclass(frozen=True)
class Comparison:
    """Designs side by side in one score."""

    score: str
    each: tuple[Interval, ...]
    """Over the conditions."""
    against_first: tuple[Interval, ...]
    """Difference to the first design, condition by condition, which conditions that differ do not blur."""
    error: ScoreError | None = None
    """Largest numerical error of the score; None where nobody measured it."""

    def surely_differs(self, place: int) -> bool:
        """Whether the difference of a design to the first excludes zero and exceeds the numerical error."""
        found = self.against_first[place]
        bound = (self.error or ScoreError()).of(max(abs(self.each[0].mean), abs(self.each[place].mean)))
        excludes_zero = found.low is not None and found.high is not None and (found.low > 0 or found.high < 0)
        return excludes_zero and abs(found.mean) > bound


def compare(table: DesignTable, places: Sequence[int], scores: Sequence[str]) -> list[Comparison]:
    """Two or more designs, by their places in the table, under the conditions that all of them finished."""
    found = []
    for score in scores:
        values = table.scores[score][list(places)]
        common = values[:, np.isfinite(values).all(0)]
        if common.shape[1]:
            each = tuple(interval(row) for row in common)
            against = tuple(interval(row - common[0]) for row in common)
            found.append(Comparison(score, each, against, table.errors.get(score)))
    return found


@dataclass(frozen=True)
class Effect:
    """What a factor does to a score, over everything else."""

    factor: str
    levels: Float[np.ndarray, " levels"]
    """Values, or the means of bins of values."""
    means: tuple[Interval, ...]


def main_effect(
    factor: str, at: Float[np.ndarray, " jobs"], score: Float[np.ndarray, " jobs"], *, exact: bool
) -> Effect:
    """Mean of a score at each value of a factor if `exact`, else in bins of about equally many values."""
    kept = np.isfinite(score)
    at, score = at[kept], score[kept]
    levels = np.unique(at)
    groups = np.array_split(levels, len(levels) if exact else min(len(levels), _BINS))
    members = [(at >= group[0]) & (at <= group[-1]) for group in groups if len(group)]
    places = np.array([at[chosen].mean() for chosen in members])
    return Effect(factor, places, tuple(interval(score[chosen]) for chosen in members))


def effects_of(frame: "polars.DataFrame", study: Study, conditions: Sequence[str]) -> dict[str, list[Effect]]:
    """What each variable and each of these conditions (columns) that takes several values does to each objective."""
    steps = study.sampler.kind in ("grid", "list")
    exact = {v.column: steps or v.distribution == "choice" for v in study.variables} | dict.fromkeys(conditions, True)
    columns = {factor: frame[factor].cast(float).to_numpy() for factor in exact}
    found: dict[str, list[Effect]] = {}
    for objective in study.objectives:
        score = frame[objective.score].cast(float).fill_null(float("nan")).to_numpy()
        varied = {factor: at for factor, at in columns.items() if len(np.unique(at[np.isfinite(score)])) > 1}
        found[objective.score] = [main_effect(name, at, score, exact=exact[name]) for name, at in varied.items()]
    return found
