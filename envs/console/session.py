"""One drive: a hand and perhaps a driver that helps it, step by step, with ways back; whatever happens is recorded."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.console.recording import Recorder
from haustra.envs.console.vehicle import Look, Vehicle
from haustra.errors import InvalidOptionError

KNOB_RATE = 0.8
"""Share of a knob's whole turn in a second while its key is held [1/s]; engineering choice."""
KNOB_RETURN = 0.5
"""Share by which a knob that is not locked goes back in a second [1/s]; engineering choice."""
LET_GO = 0.4
"""A driver that helps takes a lever again this long after the person let it go [s]; engineering choice."""
_BETWEEN, _MOST_KEPT = 1.0, 60
"""Time between two states that are kept to go back to [s], and how many."""


class Hand:
    """What a person asks for: levers held, knobs turned; nothing once it is let go."""

    def __init__(self, vehicle: Vehicle) -> None:
        """A hand on a vehicle's levers."""
        self._levers = vehicle.levers
        self.share = np.zeros(len(self._levers))
        """Share of each lever that is asked for, from -1 to 1; of knobs, of the rate at which they are turned."""
        self.knobs = np.zeros(len(self._levers))
        """Where knobs are; nothing of levers that are no knobs."""
        self.locked = np.ones(len(self._levers), bool)
        """Knobs that stay where they are when they are let go."""
        self._since = np.full(len(self._levers), np.inf)

    def hold(self, lever: int, share: float) -> None:
        """Ask for a share of a lever until further notice."""
        self.share[lever] = np.clip(share, -1.0, 1.0) if np.isfinite(share) else 0.0

    def put(self, lever: int, value: float) -> None:
        """Put a knob somewhere."""
        self.knobs[lever] = self._levers[lever].limited(value)
        self._since[lever] = 0.0

    def let_go(self) -> None:
        """Take the hand off everything."""
        self.share[:] = 0.0

    def asks(self, interval: float) -> tuple[Float[np.ndarray, " levers"], Bool[np.ndarray, " levers"]]:
        """What each lever is to be for the next control step, and whether the person holds it."""
        asked = np.zeros(len(self._levers))
        touched = self.share != 0
        self._since = np.where(touched, 0.0, self._since + interval)
        for number, lever in enumerate(self._levers):
            if lever.knob:
                turned = self.knobs[number] + KNOB_RATE * interval * self.share[number] * lever.high
                if not touched[number] and not self.locked[number]:
                    turned -= np.clip(turned, -KNOB_RETURN * interval, KNOB_RETURN * interval)
                self.knobs[number] = asked[number] = lever.limited(turned)
            else:
                asked[number] = self.share[number] * lever.high
        return asked, self._since <= LET_GO


@dataclass(frozen=True)
class _Kept:
    step: int
    vehicle: Any
    knobs: np.ndarray


class Session:
    """A vehicle that is driven step by step."""

    def __init__(self, vehicle: Vehicle, recorder: Recorder | None = None, *, assisted: bool = False) -> None:
        """Begin at the vehicle's start.

        Args:
            vehicle: what is driven.
            recorder: what notes every step, if anything does.
            assisted: whether the vehicle's own driver drives where the person does not.
        """
        self.vehicle, self.recorder, self.assisted = vehicle, recorder, assisted
        self.hand = Hand(vehicle)
        self.step, self.sound = 0, True
        self.look: Look = vehicle.look()
        self._kept: deque[_Kept] = deque(maxlen=_MOST_KEPT)
        self._marks: dict[str, _Kept] = {}
        self.correcting = False
        """Whether the person holds a lever that the driver would move."""
        self._every = max(1, round(_BETWEEN / vehicle.interval))
        self.mark("start")
        nothing = np.zeros(len(vehicle.levers))
        self._note(nothing, nothing, nothing, np.zeros(len(vehicle.levers), bool))

    @property
    def time(self) -> float:
        """Simulated time since the start [s]."""
        return self.step * self.vehicle.interval

    def hold(self, shares: Mapping[str, Any]) -> None:
        """Hold levers by shares from -1 to 1, by name, and let go of all others.

        Raises:
            InvalidOptionError: when there is no such lever.
        """
        for name in shares:
            if self.vehicle.lever(name) < 0:
                known = ", ".join(lever.name for lever in self.vehicle.levers)
                raise InvalidOptionError(f"Lever '{name}' is not known. Known: {known}.")
        for number, lever in enumerate(self.vehicle.levers):
            self.hand.hold(number, float(shares.get(lever.name, 0.0)))

    @property
    def marks(self) -> tuple[str, ...]:
        """Names of places to restart from."""
        return tuple(self._marks)

    def tick(self) -> bool:
        """One control step; False when the simulation has diverged, and nothing moves until it is gone back."""
        if not self.sound:
            return False
        vehicle, hand = self.vehicle, self.hand
        asked, touched = hand.asks(vehicle.interval)
        used, proposed = asked, np.zeros(len(asked))
        if self.assisted:
            proposed = vehicle.assist()
            used = np.where(touched, asked, proposed)
            for number, lever in enumerate(vehicle.levers):
                if lever.knob and not touched[number]:  # the knob is where the driver has turned it
                    hand.knobs[number] = used[number]
        self.correcting = bool(self.assisted and touched.any())
        self.sound = vehicle.step(used)
        if not self.sound:
            return False
        self.step += 1
        self.look = vehicle.look()
        self._note(used, asked, proposed, touched)
        if self.step % self._every == 0:
            self._kept.append(self._now())
        return True

    def back(self, seconds: float = 10.0) -> None:
        """Go back in time, as far as states were kept."""
        wanted = self.step - round(seconds / self.vehicle.interval)
        while self._kept and self._kept[-1].step > max(wanted, 0):
            self._kept.pop()
        self._go_to(self._kept[-1] if self._kept else self._marks["start"])

    def mark(self, name: str) -> None:
        """Name this place, to restart from."""
        self._marks[name] = self._now()

    def restart(self, name: str = "start") -> None:
        """Restart from a place.

        Raises:
            InvalidOptionError: when no place has that name.
        """
        if name not in self._marks:
            raise InvalidOptionError(f"Place '{name}' is not marked. Marked: {', '.join(self._marks)}.")
        self._go_to(self._marks[name])

    def change(self, name: str, value: Any) -> None:
        """Change a condition.

        Raises:
            InvalidOptionError: when there is no such condition, or it cannot be that.
        """
        self.vehicle.change(name, self.vehicle.condition(name).number(value))

    def conditions(self) -> Mapping[str, Any]:
        """Conditions by name, as they are."""
        pairs = zip(self.vehicle.conditions, self.vehicle.now(), strict=True)
        return {condition.name: condition.value(number) for condition, number in pairs}

    def close(self) -> dict[str, Any]:
        """End recording and vehicle, and say what was recorded."""
        self.vehicle.close()
        return self.end()

    def end(self) -> dict[str, Any]:
        """End the recording, and say what it holds."""
        said: dict[str, Any] = {"sound": self.sound, "simulated_s": self.time}
        said["tip_arc_m"] = float(self.look.row["tip_arc"])
        return self.recorder.close(**said) if self.recorder else said

    def _now(self) -> _Kept:
        return _Kept(self.step, self.vehicle.keep(), self.hand.knobs.copy())

    def _go_to(self, kept: _Kept) -> None:
        self.vehicle.put_back(kept.vehicle)
        self.step, self.sound = kept.step, True
        self.hand.knobs[:] = kept.knobs
        self.look = self.vehicle.look()
        while self._kept and self._kept[-1].step > self.step:
            self._kept.pop()

    def _note(self, used: np.ndarray, asked: np.ndarray, proposed: np.ndarray, touched: np.ndarray) -> None:
        if self.recorder is None:
            return
        self.recorder.add(
            self.step,
            self.look,
            levers=used,
            asked=asked,
            proposed=proposed,
            by_person=touched,
            assisted=self.assisted,
            conditions=self.vehicle.now(),
        )
