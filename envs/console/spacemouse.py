"""A SpaceMouse on the desktop as a hand: its cap pushes, turns and bends, and lets go when it says nothing.

The cap's axes are those of `pyspacemouse` with z upwards: x to the right, y away from the user. A cap off its centre
reports many times a second, and one at rest says nothing: silence is a hand that has let go.
"""

import contextlib
import math
import sys
import time
from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

from haustra.envs.console.desk_device import DeskDevice
from haustra.envs.console.source import WATCHDOG, Drive
from haustra.errors import InvalidOptionError, MissingDependencyError, UnsupportedSceneError

DEAD_ZONE = 0.15
"""Share of an axis's way within which the cap is let go [1]; engineering choice: fingers at rest move nothing."""
_REST = 0.002
"""Time between two reads [s]; engineering choice: several times a report's, so that none queues."""

_NO_LIBRARY = "A SpaceMouse needs the system's library hidapi, such as by 'apt install libhidapi-hidraw0'."


@runtime_checkable
class State(Protocol):
    """What a device has said last; axes from -1 to 1, right-handed, z upwards."""

    t: float
    """Changes with every report."""
    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float
    buttons: Sequence[int]


@runtime_checkable
class SixAxes(Protocol):
    """A device that is read without waiting."""

    def read(self) -> State:
        """What it has said last.

        Raises:
            Exception: when it was unplugged.
        """
        ...

    def close(self) -> None:
        """End the connection."""
        ...


def find_space_mouse() -> SixAxes:
    """The first SpaceMouse that is connected.

    Raises:
        MissingDependencyError: without the extra, or without the system's library for such devices.
        InvalidOptionError: when none is connected, or this user may not read it.
    """
    try:
        import pyspacemouse  # pyright: ignore[reportMissingModuleSource]
    except ImportError as error:
        raise MissingDependencyError("A SpaceMouse needs 'pip install haustra[spacemouse]'.") from error
    except OSError as error:
        raise MissingDependencyError(_NO_LIBRARY) from error
    try:
        with contextlib.redirect_stdout(sys.stderr):  # it names what it found, where a drive prints its address
            return pyspacemouse.open(axis_convention=pyspacemouse.AxisConvention.HID_Z_UP)
    except RuntimeError as error:
        if isinstance(error.__cause__, AttributeError):  # what it looked for in a library that is not there
            raise MissingDependencyError(_NO_LIBRARY) from error
        raise InvalidOptionError(
            f"No SpaceMouse can be read ({error}): connect one, or leave --spacemouse out."
        ) from error


def shares(state: State) -> dict[str, float]:
    """Shares of levers that a cap asks for, from -1 to 1; nothing within the dead zone."""
    asked = {"push": state.y, "roll": -state.yaw, "up": -state.roll, "left": -state.pitch, "gas": -state.z}
    return {name: _beyond(value) for name, value in asked.items()}


def _beyond(value: float) -> float:
    """An axis's value without its dead zone, from which it begins at nothing."""
    if not math.isfinite(value):
        return 0.0
    return math.copysign(min(max(abs(value) - DEAD_ZONE, 0.0) / (1 - DEAD_ZONE), 1.0), value)


class SpaceMouse(DeskDevice):
    """Moves the hand of all sessions of a drive."""

    def __init__(self, source: Drive, device: SixAxes) -> None:
        """Couple a device to a drive.

        Raises:
            UnsupportedSceneError: when no vehicle has a lever that the cap moves.
        """
        if all(session.vehicle.lever("push") < 0 for session in source.sessions):
            raise UnsupportedSceneError("A SpaceMouse pushes a shaft: this vehicle has none, leave --spacemouse out.")
        super().__init__(source, "spacemouse")
        self._device = device
        self._said: tuple[Mapping[str, float], float] = {}, -math.inf
        self._held: set[str] = set()
        self.connected = True
        """Whether the device can still be read."""

    @property
    def heard(self) -> float:
        """When the cap was heard of last, by `time.perf_counter` [s]."""
        return self._said[1]

    def _move(self, interval: float) -> None:
        """Let hands follow the cap until the next control step; levers that it leaves are those of the page."""
        said, at = self._said
        asked = said if time.perf_counter() - at <= WATCHDOG else {}
        held = {name for name, share in asked.items() if share}
        for session in self._source.sessions:
            for name in held | self._held:
                if (number := session.vehicle.lever(name)) >= 0:
                    session.hand.hold(number, asked.get(name, 0.0))
        self._held = held

    def _listen(self) -> None:
        before, pressed = math.nan, [0, 0]
        try:
            while not self._ends.is_set():
                state = self._device.read()
                if state.t != before:
                    before, self._said = state.t, (shares(state), time.perf_counter())
                    pressed = self._press(pressed, [*state.buttons, 0, 0][:2])
                self._ends.wait(_REST)
            self._device.close()
        except Exception:  # of whatever kind the library raises: it was unplugged
            self._said = {}, -math.inf
        self.connected = False

    def _press(self, before: Sequence[int], now: Sequence[int]) -> list[int]:
        """Do what a button does that has just been pressed: lock or unlock knobs, call for help or end it."""
        first = self._source.sessions[0]
        if now[0] and not before[0]:
            locked = not all(first.hand.locked)
            self._source.command({"lock": dict.fromkeys(("up", "left"), locked)})
        if now[1] and not before[1]:
            self._source.command({"assist": not first.assisted})
        return list(now)
