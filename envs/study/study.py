"""What a study is: a base design, what is varied, under which conditions, and what is wanted of it."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Literal, TypeAlias

from haustra.fields import number, whole
from haustra.provenance import content_hash

Value: TypeAlias = float | int | str | bool
"""What an option, a condition or a value in a row may be."""

Distribution = Literal["uniform", "log-uniform", "normal", "choice"]
SamplerKind = Literal["grid", "sobol", "latin-hypercube", "list"]
Goal = Literal["maximise", "minimise"]


@dataclass(frozen=True)
class Variable:
    """A number of the design that a study varies."""

    name: str
    """Name of the variable, and stem of its column."""
    path: str
    """Path of the number that it changes, like `design.bellows.pressure`; `*` stands for every section of a scope's
    shaft."""
    unit: str
    """Unit of all the variable's numbers, '1' when dimensionless."""
    nominal: float
    """Value of designs that do not say otherwise."""
    low: float
    """Lowest value."""
    high: float
    """Highest value."""
    distribution: Distribution = "uniform"
    """How values spread between the bounds: 'normal' is cut off at them; 'choice' takes one of `values`."""
    deviation: float | None = None
    """Standard deviation of 'normal'; a quarter of the bounds' distance when None."""
    values: tuple[float, ...] = ()
    """Values of a choice, and the levels of a grid when given."""
    levels: int = whole(1, 100_000, default=5)
    """Number of a grid's values when `values` is not given: evenly spaced in probability, bounds included."""

    @property
    def column(self) -> str:
        """Name of its column: with its unit."""
        return with_unit(self.name, self.unit)

    def at(self, quantile: float) -> float:
        """The value below which lies this share of the distribution, for a share from 0 to 1."""
        if self.distribution == "choice":
            return self.values[min(int(quantile * len(self.values)), len(self.values) - 1)]
        if self.distribution == "log-uniform":
            return float(self.low * (self.high / self.low) ** quantile)
        if self.distribution == "normal":
            from scipy.stats import truncnorm

            spread = self.deviation or (self.high - self.low) / 4
            ends = (self.low - self.nominal) / spread, (self.high - self.nominal) / spread
            return float(truncnorm.ppf(quantile, *ends, loc=self.nominal, scale=spread))
        return float(self.low + (self.high - self.low) * quantile)

    def grid(self) -> tuple[float, ...]:
        """Its values on a grid."""
        if self.values:
            return self.values
        if self.levels == 1:
            return (self.nominal,)
        return tuple(self.at(level / (self.levels - 1)) for level in range(self.levels))


@dataclass(frozen=True)
class Sampler:
    """Which designs are tried."""

    kind: SamplerKind = "grid"
    """How designs are chosen: on a grid, by Sobol's sequence, by a Latin hypercube, or from a list."""
    count: int = whole(1, 10_000_000, default=64)
    """Number of designs of 'sobol' (a power of two balances it) and 'latin-hypercube'."""
    seed: int = whole(0, 2**32 - 1, default=0)
    """Seed of all random draws."""
    designs: tuple[Mapping[str, Value], ...] = ()
    """Designs of sampler 'list': for each a `name`, and a value for every variable that is not nominal."""


@dataclass(frozen=True)
class Objective:
    """A score and which way is better."""

    score: str
    """Name of the score."""
    goal: Goal
    """Whether more or less of it is better."""


@dataclass(frozen=True)
class Budget:
    """What a study may take."""

    jobs: int = whole(1, 100_000_000, default=100_000)
    """Largest number of jobs; a study that asks for more is refused."""
    job_seconds: float | None = number("s", 1e-3, 1e7, default=None)
    """Longest time for one job [s]; a job that takes longer fails. No limit when None."""
    trials: int = whole(1, 10_000_000, default=64)
    """Number of designs that `haustra optimise` tries."""
    generation: int = whole(1, 100_000, default=8)
    """Designs that it proposes at once, knowing those of all generations before: as many as keep the cores busy."""


@dataclass(frozen=True)
class Study:
    """A question, and every choice that shapes its answer. JSON values only."""

    question: str
    title: str
    base: str
    """Name or file of the design that is varied."""
    variables: tuple[Variable, ...]
    conditions: Mapping[str, tuple[Value, ...]]
    """Values of each condition; every design is tried under every combination of them."""
    objectives: tuple[Objective, ...]
    sampler: Sampler = field(default_factory=Sampler)
    scores: tuple[str, ...] = ()
    """Columns that are wanted; all that the question has when empty."""
    changes: Mapping[str, float] = field(default_factory=dict)
    """Path to value: what the base differs in from the design it names."""
    options: Mapping[str, Value] = field(default_factory=dict)
    """How it is simulated; what they may be depends on the question."""
    budget: Budget = field(default_factory=Budget)
    inputs: Mapping[str, str] = field(default_factory=dict)
    """Content hash of every file that the study names."""

    def to_json(self) -> dict:
        """As plain JSON values."""
        return asdict(self)

    @property
    def hash(self) -> str:
        """Hash of everything that shapes the rows; what a study is called and what it may take does not."""
        shaping = {key: value for key, value in self.to_json().items() if key not in ("title", "budget")}
        return content_hash(json.dumps(shaping, sort_keys=True).encode())

    @classmethod
    def from_json(cls, values: Mapping) -> "Study":
        """What `to_json` gave, also after JSON has turned tuples into lists."""
        return cls(
            **{
                **values,
                "variables": tuple(
                    Variable(**{**entry, "values": tuple(entry["values"])}) for entry in values["variables"]
                ),
                "conditions": {name: tuple(entries) for name, entries in values["conditions"].items()},
                "objectives": tuple(Objective(**entry) for entry in values["objectives"]),
                "sampler": Sampler(**{**values["sampler"], "designs": tuple(values["sampler"]["designs"])}),
                "scores": tuple(values["scores"]),
                "budget": Budget(**values["budget"]),
            }
        )


@dataclass(frozen=True)
class Job:
    """One design under one set of conditions."""

    id: int
    design: int
    variables: Mapping[str, float]
    """By the variables' names."""
    conditions: Mapping[str, Value]

    def to_json(self) -> dict:
        """As plain JSON values."""
        return asdict(self)


@dataclass(frozen=True)
class Column:
    """What a number in a row is."""

    name: str
    """With its unit at the end."""
    unit: str
    meaning: str


@dataclass(frozen=True)
class ScoreError:
    """How far a score is off at most by numerics, whatever the design."""

    relative: float = 0.0
    """Error as a share of the score's size [1]."""
    absolute: float = 0.0
    """In the score's unit."""

    def of(self, size: float) -> float:
        """Error of a score of that size, in its unit."""
        return self.relative * abs(size) + self.absolute


@dataclass(frozen=True)
class Result:
    """How a job ended."""

    job: int
    state: Literal["finished", "failed", "diverged"]
    scores: Mapping[str, Value | None] = field(default_factory=dict)
    """Empty unless finished: what a diverged simulation computed is no number."""
    reason: str = ""
    """Why it failed or diverged, in one line."""
    curves: Mapping[str, list[float]] = field(default_factory=dict)
    """The first over which the others are drawn; names carry units."""

    def __post_init__(self) -> None:
        numbers = [value for value in self.scores.values() if isinstance(value, float)]
        if not all(map(math.isfinite, numbers)):
            raise ValueError(f"Job {self.job} has a score that is not finite: a runner must call it diverged.")

    def to_json(self) -> dict:
        """As plain JSON values."""
        return asdict(self)


def with_unit(name: str, unit: str) -> str:
    """Name of a column: 'pressure' in 'Pa' is 'pressure_Pa', 'm/s' becomes 'm_s'."""
    suffix = unit.replace("/", "_").replace("^", "").replace(" ", "")
    return name if unit == "1" else f"{name}_{suffix}"
