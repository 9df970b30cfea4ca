"""Grown colons against published anatomy: many seeds, each measured, then compared with every source."""

import csv
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import f as f_distribution

from haustra.assets import asset
from haustra.errors import HaustraError, UnreadableFileError
from haustra.files import prepare_folder, write_json
from haustra.models.anatomy.crossings import crossing_triangles
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.measures import anatomy_of
from haustra.models.anatomy.store import colon_hash
from haustra.provenance import Provenance, content_hash
from haustra.scripts.bench.result import LEAST_CASES

CONFIDENCE = 0.95
"""Confidence level of the intervals of differences: all of an interval has to lie within the tolerance."""
MEAN_TOLERANCE, SPREAD_TOLERANCE = 0.1, 1.5
"""Largest relative difference of means, and largest ratio of standard deviations either way, that count as agreement;
engineering choices: cohorts of one study differ by a tenth in length, and by a half in spread."""
NORMAL_QUANTILE = 1.96
"""Two-sided quantile of the normal distribution at that confidence."""
CHAIN = 0.01
"""A course keeps its length to 1 %, and so do the borders of its segments: ranges are taken so much wider."""


@dataclass(frozen=True)
class Published:
    """One published figure, and how cases are held to it."""

    measure: str
    """Name in `anatomy_of`."""
    group: str
    """Cohort, with or without sex; empty for all."""
    rule: str
    """mean and sd, mean, mean within, mean above, all within, all below, or 95 % below."""
    mean: float | None
    sd: float | None
    n: float | None
    low: float | None
    high: float | None
    source: str


@dataclass(frozen=True)
class Verdict:
    """How grown colons compare with one published figure."""

    published: Published
    cases: int
    """Grown colons that it was held against."""
    mean: float
    sd: float
    smallest: float
    largest: float
    low: float
    """Lowest value that passes, of what the rule looks at."""
    high: float
    """Highest one."""
    passed: bool
    shown: bool = True
    """Whether the cases were enough to tell: too few, or an interval on both sides of a tolerance, tell nothing."""


def published_figures() -> list[Published]:
    """The figures of assets/anatomy/published.csv."""
    with asset("anatomy/published.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    return [
        Published(
            measure=row["measure"],
            group=row["group"],
            rule=row["rule"],
            mean=_number(row["mean"]),
            sd=_number(row["sd"]),
            n=_number(row["n"]),
            low=_number(row["low"]),
            high=_number(row["high"]),
            source=row["source"],
        )
        for row in rows
    ]


def measure_case(
    seed: int, *, cohort: str = "japan-ctc", sex: str = "any", difficulty: str = "any"
) -> dict[str, object]:
    """Grow one colon and measure it, as JSON values; a seed that gives none says why."""
    options = {"seed": seed, "cohort": cohort, "difficulty_asked": difficulty}
    try:
        colon = grow_colon(seed=seed, cohort=cohort, sex=sex, difficulty=difficulty)
    except HaustraError as error:
        return {**options, "failed": str(error)}
    person = dict(colon.provenance.configuration)["recipe"]["person"]  # pyright: ignore[reportIndexIssue]
    return {
        **options,
        "sex": person["sex"],
        "difficulty": person["difficulty"],
        "tortuosity": person["tortuosity"],
        "hash": colon_hash(colon),
        "triangles": len(colon.lumen.faces),
        "crossings": len(crossing_triangles(colon.lumen)),
        **anatomy_of(colon),
    }


def measure_cases(
    folder: Path,
    seeds: Iterable[int],
    *,
    cohort: str = "japan-ctc",
    progress: Callable[[float, str], None] = lambda done, note: None,
) -> list[dict]:
    """Measure one colon a seed, keeping each in `folder`, so that an interrupted run goes on where it stopped.

    Raises:
        OutputError: when the folder cannot be written.
    """
    folder = prepare_folder(folder / cohort)
    rows = []
    for done, seed in enumerate(seeds):
        progress(done, f"seed {seed}")
        file = folder / f"{seed:06d}.json"
        row = _finished(file)
        if row is None:
            row = measure_case(seed, cohort=cohort)
            write_json(file, {"provenance": _provenance(seed).to_json(), "case": row})
        rows.append(row)
    progress(len(rows), "")
    return rows


def compare(rows: Sequence[Mapping], figures: Sequence[Published] | None = None) -> list[Verdict]:
    """Hold cases against published figures; a figure for which there are no two cases is left out."""
    return [
        _verdict(figure, values)
        for figure in (published_figures() if figures is None else figures)
        if len(values := values_of(rows, figure)) > 1
    ]


def values_of(rows: Sequence[Mapping], figure: Published) -> np.ndarray:
    """What the cases of a figure's group measure."""
    cohort, _, sex = figure.group.partition(" ")
    chosen = [
        row[figure.measure]
        for row in rows
        if figure.measure in row and cohort in ("", row["cohort"]) and sex in ("", row["sex"])
    ]
    return np.array(chosen, dtype=float)


def _verdict(figure: Published, values: np.ndarray) -> Verdict:
    mean, sd = float(values.mean()), float(values.std(ddof=1))
    facts = (figure, len(values), mean, sd, float(values.min()), float(values.max()))
    if figure.rule in ("mean", "mean and sd") and figure.mean is not None and figure.n is not None:
        low, high = figure.mean * (1 - MEAN_TOLERANCE), figure.mean * (1 + MEAN_TOLERANCE)
        spread = sd if figure.sd is None else figure.sd  # no spread published: the grown colons' own
        error = NORMAL_QUANTILE * float(np.sqrt(spread**2 / figure.n + sd**2 / len(values)))
        found = [_within(mean - error, mean + error, low, high)]
        if figure.rule == "mean and sd":
            edges = f_distribution.ppf([(1 + CONFIDENCE) / 2, (1 - CONFIDENCE) / 2], len(values) - 1, figure.n - 1)
            least, most = (float(sd / spread / np.sqrt(edge)) for edge in edges)
            found.append(_within(least, most, 1 / SPREAD_TOLERANCE, SPREAD_TOLERANCE))
        if len(values) < LEAST_CASES:
            found = [None]
        return Verdict(*facts, low, high, passed=all(found), shown=None not in found or False in found)
    wider = CHAIN if figure.measure.endswith("length_m") else 0.0
    low = -np.inf if figure.low is None else figure.low * (1 - wider)
    high = np.inf if figure.high is None else figure.high * (1 + wider)
    looked_at = {
        "mean within": [mean],
        "mean above": [mean],
        "all within": values,
        "all below": values,
        "95 % below": [np.quantile(values, 0.95)],
    }[figure.rule]
    inside, enough = bool(low <= min(looked_at) and max(looked_at) <= high), len(values) >= LEAST_CASES
    return Verdict(*facts, low, high, passed=inside and enough, shown=enough or not inside)


def _within(low: float, high: float, least: float, most: float) -> bool | None:
    """Whether all of an interval lies within a tolerance; None where it lies on both sides of its edge."""
    if least <= low and high <= most:
        return True
    return False if high < least or low > most else None


def _number(text: str) -> float | None:
    return float(text) if text else None


def _finished(file: Path) -> dict | None:
    """A case that was measured before, if this version of the code measured it."""
    if not file.exists():
        return None
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
        row, before = document["case"], document["provenance"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UnreadableFileError(f"'{file}' is no measured case ({error}): delete it.") from error
    now = _provenance(0).to_json()
    return row if all(before.get(key) == now[key] for key in ("versions", "inputs")) else None


def _provenance(seed: int) -> Provenance:
    numbers = content_hash(asset("numbers/anatomy.toml").read_bytes())
    return Provenance(inputs={"numbers/anatomy.toml": numbers}, configuration={"seed": seed})
