"""What a benchmark says: tables, fronts of error against cost, bars with what was measured. Plain values for JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import numpy as np

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
    sense: Literal["at least", "at most"]

    @property
    def met(self) -> bool:
        """False as well when nothing finite was measured."""
        if not np.isfinite(self.measured):
            return False
        return bool(self.measured >= self.bound if self.sense == "at least" else self.measured <= self.bound)


@dataclass(frozen=True)
class Bench:
    """Everything that one benchmark measured."""

    name: str
    """Of the verb, as in `haustra bench NAME`."""
    title: str
    summary: tuple[str, ...]
    """Paragraphs that say how it was measured."""
    bars: tuple[Criterion, ...] = ()
    fronts: tuple[ParetoFront, ...] = ()
    tables: tuple[Table, ...] = ()
    machine: Mapping[str, Value] = field(default_factory=dict)
    """Date, versions, processor: `haustra.provenance`."""

    def to_json(self) -> dict[str, Any]:
        """Plain values; numbers that are not finite become null."""
        values = asdict(self)
        for bar, plain in zip(self.bars, values["bars"], strict=True):
            plain["met"] = bar.met
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
        bars=tuple(
            Criterion(**{**_without(bar, "met"), "measured": _number(bar["measured"])}) for bar in values["bars"]
        ),
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
