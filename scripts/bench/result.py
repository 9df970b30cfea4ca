"""What a benchmark says: tables, fronts of error against cost, criteria and what was measured. Plain for JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

Value = str | int | float | bool | None

Ended = Literal["completed", "diverged", "refused"]
"""How a setting fared."""


@dataclass(frozen=True)
class Table:
    """Rows under named columns; names end in their unit, as in `error_mm`."""

    title: str
    rows: tuple[Mapping[str, Value], ...]
    note: str = ""


@dataclass(frozen=True)
class Point:
    """One setting of a model: what it is, how far it is off, what it costs."""

    setting: str
    """The knobs that differ from the defaults, as `joints=40, timestep=0.005`."""
    error: float
    """Against the reference, in the front's unit; infinite when the run diverged."""
    cost: float
    """Processor seconds per simulated second, or per solution where nothing moves."""
    group: str = ""
    """The knob that is swept, for the colour."""
    outcome: Ended = "completed"


@dataclass(frozen=True)
class ParetoFront:
    """A question's sweep: every point, against one reference."""

    question: str
    reference: str
    """What error is measured against, and what is known of its own error."""
    error_unit: str
    cost_unit: str
    points: tuple[Point, ...]

    def best(self) -> tuple[Point, ...]:
        """The Pareto front: points that no other beats in both error and cost, cheapest first."""
        kept: list[Point] = []
        for point in sorted(self.points, key=lambda each: (each.cost, each.error)):
            if point.outcome == "completed" and np.isfinite(point.error) and (not kept or point.error < kept[-1].error):
                kept.append(point)
        return tuple(kept)


@dataclass(frozen=True)
class Criterion:
    """A bound that was set beforehand, and what was measured."""

    what: str
    measured: float
    bound: float
    unit: str
    sense: Literal["at least", "at most", "within"]
    interval: tuple[float, float] | None = None
    """95 % confidence of a mean difference: 'within' asks that all of it lies from -bound to +bound."""

    @property
    def met(self) -> bool:
        """False as well when nothing finite was measured, and when too little was to show it."""
        if not np.isfinite(self.measured):
            return False
        if self.sense == "within":
            return self.interval is not None and max(map(abs, self.interval)) <= self.bound
        return bool(self.measured >= self.bound if self.sense == "at least" else self.measured <= self.bound)

    @property
    def verdict(self) -> Literal["met", "not met", "not shown"]:
        """Not shown: the interval lies on both sides of the bound, so that more cases may say either."""
        if self.met:
            return "met"
        if self.sense == "within" and self.interval is not None:
            low, high = self.interval
            return "not shown" if low <= self.bound and high >= -self.bound else "not met"
        return "not met"


LEAST_CASES = 10
"""Equivalence is not shown by fewer cases, however little they happen to scatter."""


def mean_interval(values: Float[np.ndarray, " cases"]) -> tuple[float, float, float]:
    """Mean and its 95 % confidence by Student's t; without bounds below `LEAST_CASES`."""
    mean, count = float(np.mean(values)), len(values)
    if count < LEAST_CASES:
        return mean, -np.inf, np.inf
    from scipy import stats

    half = float(stats.t.ppf(0.975, count - 1) * stats.sem(values))
    return mean, mean - half, mean + half


def equivalence(what: str, differences: Float[np.ndarray, " cases"], *, tolerance: float, unit: str) -> Criterion:
    """Whether a mean difference is shown to be within a tolerance: the whole of its interval has to be.

    Fewer cases have a wider interval, so that they make it harder and not easier (Schuirmann 1987, doi
    10.1007/BF01068419).
    """
    mean, low, high = mean_interval(differences)
    return Criterion(what, mean, tolerance, unit, "within", (low, high))


@dataclass(frozen=True)
class Bench:
    """Everything that one benchmark measured."""

    name: str
    """Name of the benchmark, as in `haustra bench NAME`."""
    title: str
    summary: tuple[str, ...]
    """Paragraphs that say how it was measured."""
    criteria: tuple[Criterion, ...] = ()
    fronts: tuple[ParetoFront, ...] = ()
    tables: tuple[Table, ...] = ()
    machine: Mapping[str, Value] = field(default_factory=dict)
    """Date, versions, processor: `haustra.provenance`."""

    def to_json(self) -> dict[str, Any]:
        """Plain values; numbers that are not finite become null."""
        values = asdict(self)
        for criterion, plain in zip(self.criteria, values["criteria"], strict=True):
            plain["met"], plain["verdict"] = criterion.met, criterion.verdict
        for front, plain in zip(self.fronts, values["fronts"], strict=True):
            plain["best"] = [point.setting for point in front.best()]
        return _finite(values)


def bench_from_json(values: Mapping[str, Any]) -> Bench:
    """The benchmark that `Bench.to_json` wrote.

    Raises:
        KeyError, TypeError: when it is something else.
    """
    return Bench(
        name=values["name"],
        title=values["title"],
        summary=tuple(values["summary"]),
        criteria=tuple(map(_criterion, values["criteria"])),
        fronts=tuple(
            ParetoFront(
                **_without(front, "best", "points"),
                points=tuple(
                    Point(**{**point, "error": _number(point["error"]), "cost": _number(point["cost"])})
                    for point in front["points"]
                ),
            )
            for front in values["fronts"]
        ),
        tables=tuple(Table(table["title"], tuple(table["rows"]), table["note"]) for table in values["tables"]),
        machine=values["machine"],
    )


def _criterion(values: Mapping[str, Any]) -> Criterion:
    ends = values.get("interval")
    if ends is not None:
        low, high = ends
        ends = (-np.inf if low is None else low, np.inf if high is None else high)
    plain = _without(values, "met", "verdict", "interval")
    return Criterion(**{**plain, "measured": _number(values["measured"])}, interval=ends)


def observed_orders(steps: Sequence[float], errors: Sequence[float]) -> tuple[float, ...]:
    """Slopes of log error over log step between neighbours: 2 where halving the step quarters the error."""
    return tuple(np.diff(np.log(errors)) / np.diff(np.log(steps)))


def _without(values: Mapping[str, Any], *names: str) -> dict[str, Any]:
    return {name: value for name, value in values.items() if name not in names}


def _number(value: float | None) -> float:
    return float("inf") if value is None else value


def _finite(values: Any) -> Any:
    match values:
        case Mapping():
            return {name: _finite(value) for name, value in values.items()}
        case list() | tuple():
            return [_finite(value) for value in values]
        case float() | np.floating():
            return float(values) if np.isfinite(values) else None
        case np.integer() | np.bool_():
            return values.item()
    return values
