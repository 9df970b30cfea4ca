"""A cohort against what published colonoscopies showed: one row an observable, with interval, band and verdict."""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.assets import asset
from haustra.envs.study.cohort import LOOPS
from haustra.envs.study.store import SweepStore
from haustra.models.anatomy.landmarks import SEGMENTS

GROUP = 21
"""Patients of the study whose peaks are compared (Appleyard 2000)."""
RESAMPLES = 1000
"""Resamples of patients for intervals; engineering choice."""
FEWEST = 5
"""Fewer patients than this have no correlation."""

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Published:
    """One observable of a clinic, as assets/clinic/observables.toml gives it."""

    name: str
    summary: str
    """share, mean, median, maximum of groups of `GROUP`, rises, or correlation."""
    unit: str
    source: str
    meaning: str
    published: str
    column: str = ""
    """Column of a cohort's results; none where the summary takes several."""
    over: str = ""
    """men, women, or all when empty."""
    band: tuple[float, float] | None = None
    """In which the cohort's value must lie; None of what is only reported."""
    half: str = ""
    """choose or judge: whether numbers may be chosen by it."""
    group: str = ""
    """Observables that count as one, all of which must be inside; its own name when empty."""


@dataclass(frozen=True)
class Observable:
    """One observable of a cohort."""

    name: str
    value: float | None
    """None where too few patients came so far."""
    low: float | None
    """Lower end of the 95 % interval over patients."""
    high: float | None
    band: tuple[float, float] | None
    inside: bool | None
    """Whether the value is in the band; None of what is only reported."""

    def to_json(self) -> dict[str, Any]:
        """As plain JSON values."""
        return asdict(self)


@cache
def published() -> tuple[Published, ...]:
    """Every observable, in order."""
    listed = tomllib.loads(asset("clinic/observables.toml").read_text(encoding="utf-8"))
    return tuple(
        Published(name, **{**entry, "band": tuple(entry["band"]) if "band" in entry else None})
        for name, entry in listed.items()
    )


def rows_of(store: SweepStore, *, driver: str | None = None, device: str | None = None) -> list[Row]:
    """Scores of a store's finished patients, of one driver and device where they are named."""
    return [job["scores"] for job in _finished(store, driver, device)]


def by_patient(store: SweepStore, *, driver: str | None = None, device: str | None = None) -> dict[int, Row]:
    """Scores of a store's finished patients by number, where one driver has examined each with one device."""
    return {job["design"]: job["scores"] for job in _finished(store, driver, device)}


def _finished(store: SweepStore, driver: str | None, device: str | None) -> Iterator[Mapping[str, Any]]:
    asked = {name: value for name, value in (("driver", driver), ("device", device)) if value is not None}
    for job in store.rows():
        if job["state"] == "finished" and all(job["conditions"][name] == value for name, value in asked.items()):
            yield job


def observables(rows: Sequence[Row], *, seed: int = 0) -> list[Observable]:
    """Every published observable as a cohort shows it."""
    return [_observed(each, rows, np.random.default_rng(seed)) for each in published()]


def verdicts(found: Sequence[Observable]) -> dict[str, bool]:
    """Whether each observable is inside, those that count as one together.

    Half a metre of shaft must bring more men to the splenic flexure than women.
    """
    groups: dict[str, bool] = {}
    for about, each in zip(published(), found, strict=True):
        if each.inside is not None:
            group = about.group or about.name
            groups[group] = groups.get(group, True) and each.inside
    value = {each.name: each.value or 0.0 for each in found}
    return groups | {"half_metre": groups["half_metre"] and value["half_metre_men"] > value["half_metre_women"]}


def _observed(about: Published, rows: Sequence[Row], rng: np.random.Generator) -> Observable:
    sexes = {"men": "male", "women": "female"}
    own = [row for row in rows if not about.over or row["sex"] == sexes[about.over]]
    if about.column:
        own = [row for row in own if row[about.column] is not None]
    value = _summary(about, own, rng) if own else None
    if value is None:
        return Observable(about.name, None, None, None, about.band, None if about.band is None else False)
    if about.summary == "share":
        low, high = wilson(sum(float(row[about.column]) for row in own), len(own))
    elif about.summary == "maximum":
        low, high = np.percentile(_maxima(about, own, rng), [2.5, 97.5])
    else:
        drawn = (_summary(about, [own[i] for i in rng.integers(len(own), size=len(own))], rng) for _ in range(200))
        low, high = np.percentile([each for each in drawn if each is not None], [2.5, 97.5])
    inside = None if about.band is None else bool(about.band[0] <= value <= about.band[1])
    return Observable(about.name, float(value), float(low), float(high), about.band, inside)


def _summary(about: Published, rows: Sequence[Row], rng: np.random.Generator) -> float | None:
    if about.summary == "rises":
        return _rises(rows)
    if about.summary == "correlation":
        return _correlation(rows)
    if about.summary == "maximum":
        return float(_maxima(about, rows, rng).mean())
    values = np.array([float(row[about.column]) for row in rows])
    return float(np.median(values) if about.summary == "median" else values.mean())


def _maxima(about: Published, rows: Sequence[Row], rng: np.random.Generator) -> Float[np.ndarray, " groups"]:
    """Largest values of groups of as many patients as the published study had."""
    values = np.array([float(row[about.column]) for row in rows])
    if len(values) <= GROUP:
        return values.max(keepdims=True)
    return np.array([rng.choice(values, GROUP, replace=False).max() for _ in range(RESAMPLES)])


def _rises(rows: Sequence[Row]) -> float | None:
    """Steps from one segment to the next at which the mean force rises; those that nobody passed do not."""
    means = []
    for name in SEGMENTS:
        values = [row[f"axial_{name}_N"] for row in rows if row[f"axial_{name}_N"] is not None]
        means.append(float(np.mean(values)) if values else -np.inf)
    return float(sum(after > before for before, after in pairwise(means)))


def _correlation(rows: Sequence[Row]) -> float | None:
    """The rank correlation of a kind of loop at the splenic flexure with the time to the caecum that is largest.

    Kinds that `FEWEST` patients and more have and have not; None where there is no such kind.
    """
    from scipy.stats import spearmanr

    there = [row for row in rows if row["caecum"] and row["at_flexure_N"] is not None]
    if len(there) < FEWEST:
        return None
    times, found = [row["time_s"] for row in there], []
    for kind in LOOPS:
        seen = np.array([row[f"at_flexure_{kind}"] for row in there])
        if FEWEST <= seen.sum() <= len(seen) - FEWEST:
            found.append(float(np.asarray(spearmanr(seen, times))[0]))
    return max(found, key=abs, default=None)


def wilson(hits: float, count: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    z = 1.959964
    middle = (hits + z**2 / 2) / (count + z**2)
    half = z / (count + z**2) * np.sqrt(hits * (count - hits) / count + z**2 / 4)
    return float(max(middle - half, 0.0)), float(min(middle + half, 1.0))
