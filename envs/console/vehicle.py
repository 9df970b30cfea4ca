"""What can be driven live: levers that a hand moves, conditions that may change meanwhile, and what is seen of it."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import blake2b
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.envs.view.picture.lens import Lens
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.wall.lumen_table import Tables


@dataclass(frozen=True)
class Lever:
    """One thing that a hand moves."""

    name: str
    unit: str
    low: float
    high: float
    knob: bool = False
    """It stays where it was put, as a locked angulation knob does; otherwise it asks for nothing once it is let go."""
    about: str = ""

    def limited(self, value: float) -> float:
        """The value within the lever's limits; nothing where it is no number."""
        return float(np.clip(value, self.low, self.high)) if np.isfinite(value) else 0.0


@dataclass(frozen=True)
class Condition:
    """One thing that may change while something is driven."""

    name: str
    unit: str
    low: float
    high: float
    choices: tuple[str, ...] = ()
    """Words that the numbers 0, 1, … stand for; none of a condition that is a quantity."""

    def number(self, value: Any) -> float:
        """The number that stands for a value.

        Raises:
            InvalidOptionError: when the condition cannot have it.
        """
        if self.choices:
            if value not in self.choices:
                raise InvalidOptionError(f"{self.name} cannot be '{value}'. Known: {', '.join(self.choices)}.")
            return float(self.choices.index(value))
        if isinstance(value, bool) or not isinstance(value, int | float) or not self.low <= value <= self.high:
            raise InvalidOptionError(f"{self.name} is {value!r}; give {self.low:g} to {self.high:g} {self.unit}.")
        return float(value)

    def value(self, number: float) -> Any:
        """What a number stands for."""
        return self.choices[int(number)] if self.choices else number


@dataclass(frozen=True)
class Surroundings:
    """The colon that something is driven in, and what is to be known of the device to draw it."""

    colon: Colon
    """At rest, in the coordinates of what is seen."""
    tables: Tables | None
    """Tables of a colon that moves, whose coordinates begin at `origin` with columns `axes`; None where it is fixed."""
    origin: Float[np.ndarray, "3"]
    axes: Float[np.ndarray, "3 3"]
    radius: float
    """Radius of the device [m]."""
    lens: Lens
    """Lens of its camera."""


class Grasp(NamedTuple):
    """The handle of a shaft, as one who holds it feels it; along and about the shaft."""

    time: float
    """Simulated time [s]."""
    aim: Float[np.ndarray, "2"]
    """Where the hand aims [m, rad]."""
    place: Float[np.ndarray, "2"]
    """Where the handle is [m, rad]."""
    speed: Float[np.ndarray, "2"]
    """How fast it moves [m/s, rad/s]."""
    limit: Float[np.ndarray, "2"]
    """Largest force and torque of the hand [N, N m]."""


class Look(NamedTuple):
    """What is seen of a vehicle at one instant, in the colon's coordinates."""

    row: Mapping[str, Any]
    """Numbers and small arrays of every control step, by name; `time` [s], `tip` [m], `tip_frame`, `tip_arc` [m],
    `wall_force` [N] and `digest` are always there."""
    frame: Mapping[str, Any]
    """What is drawn: `shape` (nodes, 3) [m] from the rear to the tip, `pressed` (stations,) [N], `pain` (stations,) [1]
    of a colon that moves, `displacement` (nodes, 7) in the coordinates of the surroundings' tables, and where there are
    polyps, `tissue` (lesions,): what was taken (`haustra.envs.console.channel.Channel.tissue`); of a scope, `blood`
    (places, 4): where the wall bleeds (`haustra.envs.console.blood.Bled.places`)."""


class Vehicle(ABC):
    """A device in a colon that is driven one control step at a time."""

    kind: ClassVar[str]
    """Name by which a recording knows how to make it again."""
    given: Colon
    """The colon that it was made from: what a recording keeps."""
    around: Surroundings
    """Colon as physics knows it."""
    levers: tuple[Lever, ...]
    conditions: tuple[Condition, ...]
    interval: float
    """Control step [s]."""
    backend: str

    @abstractmethod
    def configuration(self) -> dict[str, Any]:
        """Everything but the colon that it is made from, as JSON values (`haustra.envs.console.vehicles`)."""

    @abstractmethod
    def step(self, levers: Float[np.ndarray, " levers"]) -> bool:
        """Advance by one control step; False when the simulation has diverged."""

    @abstractmethod
    def look(self) -> Look:
        """What is seen now."""

    @property
    def said(self) -> str:
        """What came of what was done last, in words; nothing where there is nothing to say."""
        return ""

    @abstractmethod
    def assist(self) -> Float[np.ndarray, " levers"]:
        """What its own driver would do now."""

    @abstractmethod
    def change(self, name: str, number: float) -> None:
        """Set a condition."""

    @abstractmethod
    def now(self) -> Float[np.ndarray, " conditions"]:
        """Conditions as they are."""

    @abstractmethod
    def keep(self) -> Any:
        """The whole state, to go back to."""

    @abstractmethod
    def put_back(self, kept: Any) -> None:
        """Go back to a state that was kept; going on from there is the same to the bit."""

    def grasp(self) -> Grasp | None:
        """The handle of its shaft; None of what has none."""
        return None

    def begin(self, start: Any, seed: int | None) -> None:
        """Begin again at a start that was kept; the seed is of what is drawn at random, where anything is."""
        self.put_back(start)

    def close(self) -> None:
        """End what is held open."""
        return

    def lever(self, name: str) -> int:
        """Number of a lever; -1 when it has none of that name."""
        return next((number for number, lever in enumerate(self.levers) if lever.name == name), -1)

    def condition(self, name: str) -> Condition:
        """The condition of that name.

        Raises:
            InvalidOptionError: when it has none.
        """
        for condition in self.conditions:
            if condition.name == name:
                return condition
        known = ", ".join(one.name for one in self.conditions) or "none"
        raise InvalidOptionError(f"Condition '{name}' cannot be changed here. Known: {known}.")


class Repeating(Vehicle):
    """A vehicle whose backend keeps no states: to go back, it begins again and goes through all steps, bit by bit."""

    _done: list[tuple[np.ndarray, np.ndarray]]
    """Levers and conditions of every step since the start."""

    @abstractmethod
    def restart(self) -> None:
        """Go back to the start, under the conditions of then."""

    @abstractmethod
    def advance(self, levers: Float[np.ndarray, " levers"]) -> bool:
        """Advance by one control step within the levers' limits; False when the simulation has diverged."""

    def step(self, levers: Float[np.ndarray, " levers"]) -> bool:
        """Advance by one control step, and remember it."""
        asked = np.array([one.limited(value) for one, value in zip(self.levers, levers, strict=True)])
        self._done.append((asked, self.now()))
        return self.advance(asked)

    def keep(self) -> int:
        """How many steps led here."""
        return len(self._done)

    def put_back(self, kept: int) -> None:
        """Begin again and go through the steps up to there."""
        done, self._done = self._done[:kept], []
        self.restart()
        for levers, conditions in done:
            for number in np.flatnonzero(conditions != self.now()):
                self.change(self.conditions[number].name, float(conditions[number]))
            self.step(levers)


def digest(*arrays: np.ndarray) -> int:
    """A number that tells states apart by their bits."""
    found = blake2b(digest_size=8)
    for array in arrays:
        found.update(np.ascontiguousarray(array).tobytes())
    return int.from_bytes(found.digest(), "little", signed=True)
