"""What one part of the stability benchmark is given, and what it finds."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from haustra.scripts.bench.result import Criterion, Table

Progress = Callable[[float, str], None]
"""Told which share of a part is done, from 0 to 1, and a note."""


@dataclass(frozen=True)
class RunOptions:
    """How a part is to run."""

    folder: Path
    """Takes finished rows, from which an interrupted run goes on."""
    quick: bool = False
    """Fewer and shorter: minutes instead of hours."""
    workers: int = 1
    """Child processes of the parts that have many independent runs."""
    deadline: float = math.inf
    """No run of a part that has many is begun after that [s, as `time.monotonic` counts]."""
    seed: int = 0
    """Seed of all random draws."""
    colon: Path | None = None
    """Folder of a colon to push a tip about in besides the grown one."""


@dataclass(frozen=True)
class Part:
    """What was found."""

    criteria: tuple[Criterion, ...]
    tables: tuple[Table, ...] = ()
    summary: str = ""
    """How it was measured."""
    counts: Mapping[str, float] = field(default_factory=dict)
    """How much was run, by name."""
    planned: Mapping[str, float] = field(default_factory=dict)
    """How much was to be run, of the same names; what is short of it is said with the result."""

    @property
    def unfinished(self) -> str:
        """What is short of the plan; empty when nothing is."""
        short = [(name, self.counts.get(name, 0.0), plan) for name, plan in self.planned.items()]
        return ", ".join(f"{done:,.0f} of {plan:,.0f} {name}" for name, done, plan in short if done < plan)
