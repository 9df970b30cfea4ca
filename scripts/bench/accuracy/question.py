"""A question of run time against error: what it is asked with, and what its answer holds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from haustra.scripts.bench.result import Criterion, ParetoFront, Table


@dataclass(frozen=True)
class Effort:
    """How much may be spent, and on what data."""

    quick: bool = False
    """A few minutes for all questions instead of an hour: coarser references, fewer settings."""
    colons: tuple[Path, ...] = ()
    """Folders of colons besides the grown one, for insertions."""
    rods: Path | None = None
    """Folder of measured rods (`haustra bench rods`)."""
    kept: Path | None = None
    """Folder in which grown colons and walls are kept; a temporary one when None."""
    tell: Callable[[str], None] = field(default=lambda note: None)
    """Told what is being done."""


@dataclass(frozen=True)
class Answer:
    """What one question found."""

    fronts: Sequence[ParetoFront] = ()
    tables: Sequence[Table] = ()
    criteria: Sequence[Criterion] = ()
    notes: Sequence[str] = ()
    """Sentences that say how it was measured, or why it was not."""


@dataclass(frozen=True)
class Question:
    """One thing that is asked of the simulator."""

    name: str
    title: str
    answer: Callable[[Effort], Answer]
