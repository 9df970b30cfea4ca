"""What a report is made of: a list of these."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


@dataclass(frozen=True)
class Highlights:
    """The few numbers that a reader came for, in large type."""

    values: Mapping[str, str]
    """Label to value with unit."""


@dataclass(frozen=True)
class Text:
    """A heading with paragraphs of plain text."""

    title: str
    paragraphs: Sequence[str]


@dataclass(frozen=True)
class Warnings:
    """What a reader should know before relying on the result; nothing is shown when there is none."""

    messages: Sequence[str]


@dataclass(frozen=True)
class Table:
    """Rows of plain text under a header."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    """Each row as long as the header."""
    note: str = ""
    """Plain text below the table."""

    def __post_init__(self) -> None:
        if any(len(row) != len(self.header) for row in self.rows):
            raise ValueError(f"Table '{self.title}' has rows that are not as long as its header.")


@dataclass(frozen=True)
class Picture:
    """A PNG file or a film as WebP, put into the page."""

    title: str
    path: Path
    caption: str = ""


@dataclass(frozen=True)
class Gallery:
    """Pictures beside each other where the page is wide enough."""

    title: str
    pictures: Sequence[Picture]


@dataclass(frozen=True)
class Chart:
    """Curves over a common axis, which a reader can zoom and read values from."""

    title: str
    x_label: str
    """Axis label with unit, 'time [s]'."""
    x: Float[np.ndarray, " samples"]
    panels: Mapping[str, Mapping[str, Float[np.ndarray, " samples"]]] = field(default_factory=dict)
    """For each panel, from top to bottom, its axis label with unit, and its curves by name."""


@dataclass(frozen=True)
class Plot:
    """A figure of the plotting library, which a reader can zoom and read values from."""

    title: str
    figure: "Figure"
    note: str = ""
    """Plain text below it."""


@dataclass(frozen=True)
class Player:
    """A run that a reader plays, turns and stops."""

    title: str
    motion: Sequence[str]
    """Messages as `haustra.envs.console.motion` writes them."""
    note: str = ""
    """Plain text below it."""


Section: TypeAlias = Highlights | Player | Text | Warnings | Table | Picture | Gallery | Chart | Plot
