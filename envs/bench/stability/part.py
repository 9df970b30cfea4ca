"""What one part of the stability benchmark is given, and what it finds."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from haustra.envs.bench.result import Bar, Table

Progress = Callable[[float, str], None]
"""Told which share of a part is done, from 0 to 1, and a note."""


@dataclass(frozen=True)
class Order:
    """How a part is to run."""

    folder: Path
    """Takes finished rows, from which an interrupted run goes on."""
    quick: bool = False
    """Fewer and shorter: minutes instead of hours."""
    workers: int = 1
    """Child processes of the parts that have many independent runs."""
    seed: int = 0
    """Of everything drawn."""
    colon: Path | None = None
    """Folder of a colon to push a tip about in besides the grown one."""


@dataclass(frozen=True)
class Part:
    """What was found."""

    bars: tuple[Bar, ...]
    tables: tuple[Table, ...] = ()
    summary: str = ""
    """How it was measured."""
    counts: dict[str, float] = field(default_factory=dict)
    """How much was run, by name."""
