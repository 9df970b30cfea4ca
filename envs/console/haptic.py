"""The port for a haptic device of one's own: force and torque at the device's own rate, over a socket of this machine.

Version 1, little-endian, TCP. Both sides begin with `GREETING`: four letters HAPT and the version. Then, at any rate up
to some kHz, the device sends `ASK` and is sent `ANSWER`:

    ASK     number u32, time of the device f64 [s], place along the shaft f64 [m], angle about it f64 [rad],
            knobs up and left f64 f64 [-1 to 1]
    ANSWER  number u32 and time f64 as they were sent, force f64 [N], torque f64 [N m], simulated time f64 [s],
            state u32: 1 the drive goes on, 2 the shaft is held

The device is coupled to the shaft by the hand's spring and damper (`haustra.envs.sim.physics.hand`); force and torque
are those of the user on the shaft, and what the user feels is the opposite. Places count from where the device
connected. Between two control steps the handle is taken to move on as fast as it did. A device that says nothing for
`SILENCE`, or whose connection ends, has let go.
"""

import contextlib
import math
import socket
import struct
import sys
import time
from typing import NamedTuple

import numpy as np

from haustra.envs.console.desk_device import DeskDevice
from haustra.envs.console.source import Drive
from haustra.envs.console.vehicle import Grasp
from haustra.envs.sim.physics.hand import hand_force
from haustra.errors import OutputError, UnsupportedSceneError

VERSION = 1
GREETING = struct.Struct("<4sHH")
ASK = struct.Struct("<Iddddd")
ANSWER = struct.Struct("<IddddI")
MAGIC = b"HAPT"
SILENCE = 0.03
"""A device that said nothing for this long has let go [s]; with a control step of 20 ms the shaft is free in 50 ms."""
_SWITCH = 5e-4
"""Threads of Python take turns this often while a device is connected [s]: at the usual 5 ms it waits for physics."""


class _Said(NamedTuple):
    place: np.ndarray
    knobs: tuple[float, float]
    at: float


class HapticPort(DeskDevice):
    """Listens on this machine for one device at a time."""

    def __init__(self, source: Drive, *, port: int = 0) -> None:
        """Couple a device to the first session of a drive, on any free port when 0.

        Raises:
            UnsupportedSceneError: when the vehicle has no shaft to hold.
            OutputError: when the port is taken.
        """
        self._session = source.sessions[0]
        if self._session.vehicle.grasp() is None:
            raise UnsupportedSceneError("A haptic device holds a shaft: this vehicle has none, leave --haptic out.")
        super().__init__(source, "haptic")
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            self._listener.bind(("127.0.0.1", port))
        except OSError as error:
            raise OutputError(f"Cannot listen on 127.0.0.1:{port}: {error.strerror or error}.") from error
        self._listener.listen(1)
        self._listener.settimeout(0.2)
        self.port = int(self._listener.getsockname()[1])
        self._said: _Said | None = None
        self._zero = np.zeros(2)
        self._grasped: tuple[Grasp, float] = self._now(), time.perf_counter()
        self.holds = False
        """Whether a device holds the shaft."""
        self.let_go_at = -math.inf
        """When the last device was found to have let go, by `time.perf_counter` [s]."""

    def __exit__(self, *_: object) -> None:
        """Stop listening."""
        super().__exit__()
        self._listener.close()

    def _now(self) -> Grasp:
        grasp = self._session.vehicle.grasp()
        assert grasp is not None
        return grasp

    def _move(self, interval: float) -> None:
        """Let the hand follow the device until the next control step; in the thread of the drive."""
        now, said = time.perf_counter(), self._said
        grasp = self._now()
        if grasp.time != self._grasped[0].time:
            self._grasped = grasp, now
        hand, vehicle = self._session.hand, self._session.vehicle
        if said is None or now - said.at > SILENCE:
            if self.holds:
                self.holds, self.let_go_at = False, now
                hand.let_go()
            return
        self.holds = True
        rates = (said.place - grasp.aim) / interval
        for name, rate in zip(("push", "roll"), rates, strict=True):
            number = vehicle.lever(name)
            hand.hold(number, rate / vehicle.levers[number].high)
        for name, value in zip(("up", "left"), said.knobs, strict=True):
            hand.put(vehicle.lever(name), value)

    def _listen(self) -> None:
        while not self._ends.is_set():
            try:
                connection, _ = self._listener.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            usual = sys.getswitchinterval()
            sys.setswitchinterval(_SWITCH)
            try:
                with connection, contextlib.suppress(OSError, struct.error):
                    self._talk(connection)
            finally:
                sys.setswitchinterval(usual)
                self._said = None

    def _talk(self, connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.settimeout(1.0)
        magic, version, _ = GREETING.unpack(_read(connection, GREETING.size))
        connection.sendall(GREETING.pack(MAGIC, VERSION, 0))
        if magic != MAGIC or version != VERSION:
            return
        self._zero = self._now().aim
        while not self._ends.is_set():
            number, at, along, about, up, left = ASK.unpack(_read(connection, ASK.size))
            if not all(map(math.isfinite, (along, about, up, left))):
                return
            place = self._zero + np.array([along, about])
            self._said = _Said(place, (up, left), time.perf_counter())
            force, torque = self._felt(place)
            state = (0 if self._source.paused else 1) | (2 if self.holds else 0)
            connection.sendall(ANSWER.pack(number, at, force, torque, self._grasped[0].time, state))

    def _felt(self, place: np.ndarray) -> tuple[float, float]:
        """Force and torque of the device's user on the shaft now."""
        grasp, since = self._grasped
        ahead = 0.0 if self._source.paused else min(time.perf_counter() - since, self._session.vehicle.interval)
        force, torque = hand_force(np, place, grasp.place + ahead * grasp.speed, grasp.speed, grasp.limit)
        return float(force), float(torque)


def _read(connection: socket.socket, size: int) -> bytes:
    parts = b""
    while len(parts) < size:
        more = connection.recv(size - len(parts))
        if not more:
            raise ConnectionResetError
        parts += more
    return parts


class HapticClient:
    """A device's side of the port, to write one's own after."""

    def __init__(self, port: int) -> None:
        """Connect to this machine.

        Raises:
            OutputError: when nobody listens there, or another version is spoken.
        """
        try:
            self._socket = socket.create_connection(("127.0.0.1", port), timeout=2.0)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._socket.sendall(GREETING.pack(MAGIC, VERSION, 0))
            magic, version, _ = GREETING.unpack(_read(self._socket, GREETING.size))
        except OSError as error:
            raise OutputError(f"No haptic port answers on 127.0.0.1:{port}: {error}.") from error
        if (magic, version) != (MAGIC, VERSION):
            raise OutputError(f"The port speaks version {version} of the protocol, this client {VERSION}.")
        self._number = 0

    def ask(self, along: float, about: float, up: float = 0.0, left: float = 0.0) -> tuple[float, float, float]:
        """Say where the device is; force [N] and torque [N m] of its user on the shaft, and the round trip [s]."""
        self._number += 1
        begun = time.perf_counter()
        self._socket.sendall(ASK.pack(self._number, begun, along, about, up, left))
        number, _, force, torque, _, _ = ANSWER.unpack(_read(self._socket, ANSWER.size))
        assert number == self._number
        return force, torque, time.perf_counter() - begun

    def close(self) -> None:
        """Let go."""
        self._socket.close()
