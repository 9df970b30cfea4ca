"""What a model is to be believed for: context of use, model risk, evidence and applicability, read from one file.

The steps are those of FDA's guidance (Assessing the Credibility of Computational Modeling and Simulation in Medical
Device Submissions, November 2023) and ASME V&V 40-2018: a question of interest, a context of use, model risk from the
model's influence and the decision's consequence, evidence in eight categories, applicability, adequacy. A piece of
evidence is a figure that stands in a file: it is looked up there, compared with a bound, and kept with the file's hash
and date. What no file holds is no evidence.
"""

import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from haustra.errors import InvalidStudyError
from haustra.fields import named, number, read_fields, texts, whole
from haustra.provenance import file_hash
from haustra.reading import LARGEST_DOCUMENT, read_document, read_text

CATEGORIES = (
    "code verification",
    "model calibration",
    "validation on the bench",
    "validation in vivo",
    "population-based validation",
    "emergent behaviour",
    "plausibility",
    "calculation verification and uncertainty in the context of use",
)
"""The eight categories of evidence of FDA's guidance, counted from 1."""

Level = Literal["low", "medium", "high"]
_LEVELS = ("low", "medium", "high")
REQUIRED: Mapping[Level, tuple[int, ...]] = {"low": (1, 7, 8), "medium": (1, 3, 7, 8), "high": (1, 3, 4, 5, 7, 8)}
"""Categories in which evidence must stand at each model risk; engineering choice, which the guidance leaves to its
reader: a user with other goals reads the table of evidence instead."""
_FIGURE = "{figure}"
_NUMBER = r"([-−+]?\d[\d,]*(?:\.\d+)?(?:[eE][-−+]?\d+)?)"


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """A figure that stands in a file, and the bound that it is held to."""

    category: int = whole(1, 8)
    """Number of its category, from 1 to 8."""
    claim: str
    """What the figure is, without a judgement."""
    command: str
    """Command that makes the figure again."""
    file: str
    """File that holds it, relative to the context's own."""
    relation: Literal["<=", ">="]
    """Whether the figure must be at most or at least the bound."""
    bound: float = number("1", -1e12, 1e12)
    """Bound that the figure is held to, in its unit."""
    unit: str
    """Unit of figure and bound, '1' when dimensionless."""
    find: str | None = None
    """Text that stands in the file, with {figure} where the figure does."""
    key: str | None = None
    """Path of the figure in a JSON or TOML file, joined by dots; entries of lists count from 0, or are
    told by their values: [preset=balanced,mesentery=true]."""


@dataclass(frozen=True, kw_only=True)
class Range:
    """Values of one quantity for which the model is to be used."""

    name: str
    """Name of the quantity."""
    unit: str
    """Unit of it, '1' when dimensionless."""
    low: float = number("1", 1e-9, 1e9)
    """Lowest value in the context of use."""
    high: float = number("1", 1e-9, 1e9)
    """Highest value in the context of use."""


@dataclass(frozen=True, kw_only=True)
class ValidationPoint:
    """A comparison with a measurement, and where it lies."""

    name: str
    """What was compared."""
    file: str
    """File that tells of it, relative to the context's own."""
    category: int = whole(3, 5)
    """Number of its category of evidence: on the bench, in vivo, or of a population."""
    values: tuple = named("1", 1e-9, 1e9)
    """Value of each quantity there, by name; several of one are all meant."""


@dataclass(frozen=True)
class Description:
    """A part of the model and the file that describes it."""

    part: str
    """Name of the part."""
    file: str
    """File that describes it, relative to the context's own."""


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Which runs split the uncertainty of the quantity of interest."""

    devices: tuple = texts(least=2, most=2)
    """Two scopes that are compared: shipped names, or files."""
    score: str
    """Name of the score that is compared, of a study of cohorts."""
    unit: str
    """Unit of the score."""
    drivers: tuple = texts(least=1, most=4, default=("endoscopist", "follower"))
    """Drivers by name; the first is the one that the result is told for."""
    patients: int = whole(2, 10_000, default=6)
    """Number of colons."""
    parameters: int = whole(1, 1_000, default=3)
    """Number of draws of the assumed numbers, each tried in every colon."""
    seconds: float = number("s", 1.0, 3600.0, default=300.0)
    """Longest insertion [s]."""
    seed: int = whole(0, 2**32 - 1, default=0)
    """Seed of all draws."""
    measured: tuple = texts(most=100, default=())
    """Variables of patients that are not assumed but differ between people, by name."""


@dataclass(frozen=True, kw_only=True)
class ContextOfUse:
    """What a model is to be believed for."""

    title: str
    """Heading of both documents."""
    question: str
    """Question of interest."""
    context: str
    """Context of use: what is simulated, and what its result is used for."""
    quantity: str
    """Quantity of interest."""
    decision: str
    """Decision that the result informs, and what follows if it is wrong."""
    influence: Level
    """How much the model weighs in the decision beside other evidence."""
    consequence: Level
    """How bad a wrong decision would be."""
    descriptions: tuple[Description, ...]
    ranges: tuple[Range, ...]
    points: tuple[ValidationPoint, ...] = ()
    evidence: tuple[Evidence, ...] = ()
    comparison: Comparison | None = None
    excluded: tuple = texts(most=100, default=())
    """Uses that the author rules out."""

    @property
    def risk(self) -> Level:
        """Model risk: the mean of influence and consequence, rounded up."""
        return _LEVELS[-(-(_LEVELS.index(self.influence) + _LEVELS.index(self.consequence)) // 2)]


@dataclass(frozen=True)
class Found:
    """A piece of evidence with what its file says."""

    evidence: Evidence
    figure: float
    path: Path
    hash: str
    date: str
    """Day of the file's last commit, or of its last change where it is in no repository."""

    @property
    def met(self) -> bool:
        """Whether the figure is within its bound."""
        at_most = self.evidence.relation == "<="
        return self.figure <= self.evidence.bound if at_most else self.figure >= self.evidence.bound


@dataclass(frozen=True)
class Applicability:
    """How far one quantity's range in the context of use is from where the model was compared with measurements."""

    range: Range
    values: tuple[float, ...]
    """Values at validation points, rising."""

    @property
    def covered(self) -> bool:
        """Whether validation points lie on both sides of the whole range, or at its ends."""
        return bool(self.values) and self.values[0] <= self.range.low and self.range.high <= self.values[-1]

    @property
    def within(self) -> int:
        """Number of validation points in the range."""
        return sum(self.range.low <= value <= self.range.high for value in self.values)

    @property
    def factor(self) -> float | None:
        """Largest factor between an end of the range and the validation point next to it; None without any."""
        if not self.values:
            return None
        ends = (self.range.low, self.range.high)
        return max(min(max(end / value, value / end) for value in self.values) for end in ends)


def load_context(path: Path) -> ContextOfUse:
    """The context of use in a TOML file.

    Raises:
        UnreadableFileError: when the file is missing, too long or not TOML.
        InvalidStudyError: when a key is unknown or missing, or a value is not what it should be.
    """
    found: ContextOfUse = read_fields(
        ContextOfUse, read_document(path, "context of use"), path.name, error=InvalidStudyError
    )
    for index, one in enumerate(found.ranges):
        if one.low > one.high:
            raise InvalidStudyError(f"{path.name}: ranges[{index}]: low {one.low:g} is above high {one.high:g}.")
    known = {one.name for one in found.ranges}
    for index, point in enumerate(found.points):
        for name, _ in point.values:
            if name not in known:
                raise InvalidStudyError(
                    f"{path.name}: points[{index}].values: '{name}' is not known. Known: {', '.join(sorted(known))}."
                )
    for index, one in enumerate(found.evidence):
        if (one.find is None) == (one.key is None):
            raise InvalidStudyError(f"{path.name}: evidence[{index}]: give either find or key.")
        if one.find is not None and one.find.count(_FIGURE) != 1:
            raise InvalidStudyError(f"{path.name}: evidence[{index}].find: give {_FIGURE} once, where the figure is.")
    return found


def look_up(evidence: Evidence, folder: Path) -> Found:
    """A piece of evidence with its figure, read from its file.

    Raises:
        UnreadableFileError: when the file cannot be read.
        InvalidStudyError: when the figure is not in it, or not the only one.
    """
    path = (folder / evidence.file).resolve()
    figure = _at_key(path, evidence.key) if evidence.key is not None else _in_text(path, evidence.find or "")
    return Found(evidence, figure, path, file_hash(path), file_date(path))


def applicability(context: ContextOfUse) -> list[Applicability]:
    """How far each range of a context of use is from its validation points."""
    return [
        Applicability(
            one, tuple(sorted(value for point in context.points for name, value in point.values if name == one.name))
        )
        for one in context.ranges
    ]


def missing_categories(context: ContextOfUse, found: Sequence[Found]) -> list[int]:
    """Categories that the model risk asks for and in which no figure is within its bound."""
    met = {one.evidence.category for one in found if one.met}
    return [category for category in REQUIRED[context.risk] if category not in met]


def file_date(path: Path) -> str:
    """Day of a file's last commit, or, in no repository, of its last change (ISO 8601)."""
    try:
        asked = ["git", "log", "-1", "--format=%cs", "--", path.name]
        done = subprocess.run(asked, cwd=path.parent, capture_output=True, text=True, timeout=20, check=True)
        if done.stdout.strip():
            return done.stdout.strip()
    except (OSError, subprocess.SubprocessError):
        pass
    return datetime.fromtimestamp(path.stat().st_mtime, UTC).date().isoformat()


def _in_text(path: Path, find: str) -> float:
    text = read_text(path, "evidence", LARGEST_DOCUMENT)
    before, _, after = find.partition(_FIGURE)
    pattern = _spaced(before) + _NUMBER + _spaced(after)
    figures = {match.replace(",", "").replace("−", "-") for match in re.findall(pattern, text)}
    if len(figures) != 1:
        told = "does not hold" if not figures else f"holds {len(figures)} figures for"
        raise InvalidStudyError(f"'{path}' {told} '{find}': quote the text round the figure as it stands there.")
    return float(figures.pop())


def _spaced(text: str) -> str:
    """A pattern for a text whose spaces may be line breaks."""
    return r"\s+".join(map(re.escape, text.split(" ")))


def _entry(entries: list[Any], name: str) -> Any:
    """The entry of a list by its number, or the only one with values such as [preset=balanced,mesentery=true]."""
    if not name.startswith("["):
        return entries[int(name)]
    wanted = dict(part.split("=", 1) for part in name.strip("[]").split(","))
    (found,) = (each for each in entries if all(_word(each[key]) == word for key, word in wanted.items()))
    return found


def _word(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _at_key(path: Path, key: str) -> float:
    value: Any = read_document(path, "evidence")
    for name in key.split("."):
        try:
            value = _entry(value, name) if isinstance(value, list) else value[name]
        except (KeyError, IndexError, ValueError, TypeError) as error:
            raise InvalidStudyError(f"'{path}' holds nothing at '{key}': '{name}' is not there.") from error
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidStudyError(f"'{path}' holds no number at '{key}'.")
    return float(value)
