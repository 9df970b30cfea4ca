"""Hands: gestures at the handle, and the force and torque that a haptic device would give back."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.physics.hand import hand_force
from haustra.envs.sim.state import Controls
from haustra.errors import InvalidOptionError


@dataclass(frozen=True)
class Gesture:
    """What a hand does for a while: steady push and turn, and jiggling upon it."""

    duration: float
    """[s]."""
    push_rate: float = 0.0
    """Steady speed inwards; negative pulls back, which shortens a bowed colon [m/s]."""
    roll_rate: float = 0.0
    """Steady speed of turning, clockwise seen from the handle [rad/s]."""
    jiggle_amplitude: float = 0.0
    """Half the stroke of quick strokes in and out [m]."""
    jiggle_frequency: float = 3.0
    """Strokes per second [Hz]."""
    pulls: tuple[float, float, float, float] = field(default=(0.0, 0.0, 0.0, 0.0))
    """Pull of each wire: up, left, down, right [N]."""
    wheels: tuple[float, float] | None = None
    """Wire that the wheels have taken up, towards up and left [m]; steers instead of `pulls` when given."""

    def __post_init__(self) -> None:
        finite = (self.duration, self.push_rate, self.roll_rate, self.jiggle_amplitude, self.jiggle_frequency)
        if (
            not all(map(math.isfinite, (*finite, *self.pulls, *(self.wheels or ()))))
            or self.duration <= 0
            or min(finite[3:]) < 0
        ):
            raise InvalidOptionError("A gesture needs finite numbers, a positive duration and no negative jiggling.")

    def inputs(self, time: float) -> Controls:
        """Inputs `time` after the gesture began [s]; jiggling starts and ends where the steady motion is."""
        turn = 2 * math.pi * self.jiggle_frequency
        jiggle = self.jiggle_amplitude * turn * math.cos(turn * time)
        wheels = None if self.wheels is None else np.array(self.wheels)
        return Controls(self.push_rate + jiggle, self.roll_rate, np.array(self.pulls), wheels)


def inputs_at(gestures: Sequence[Gesture], time: float) -> Controls | None:
    """Inputs of a sequence of gestures at `time` [s]; None when all are done."""
    for gesture in gestures:
        if time < gesture.duration:
            return gesture.inputs(time)
        time -= gesture.duration
    return None


class HapticHandle:
    """A scene's handle for a device that moves at its own, higher rate.

    The device is coupled to the shaft by the hand's spring and damper. Between two steps of the backend the shaft is
    taken to move on with its speed and acceleration, so that force and torque are there at any rate and do not jump at
    a step: what is left is what the acceleration itself jumps by.
    """

    def __init__(self, engine: NativeEngine, *, rate: float = 1000.0) -> None:
        """Couple a device that calls `advance` at `rate` [Hz].

        Raises:
            InvalidOptionError: when the device is slower than the backend's own steps.
        """
        self.engine = engine
        self.period = 1 / rate if rate > 0 else math.inf
        self._step = engine.scene.options.timestep
        if self.period > self._step * (1 + 1e-9):
            raise InvalidOptionError(f"A device at {rate} Hz is slower than the scene's steps of {self._step} s.")
        self._ahead = 0.0
        self._acceleration = np.zeros(2)
        self._force_limits = engine.model.actuator_forcerange[
            [engine.model.actuator(f"scope/{n}").id for n in _AXES], 1
        ]

    def advance(
        self,
        position: float,
        roll: float,
        pulls: Float[np.ndarray, "4"] | None = None,
        *,
        wheels: Float[np.ndarray, "2"] | None = None,
    ) -> tuple[float, float]:
        """One period of the device: where it is now, and the force [N] and torque [N m] it must give back.

        Args:
            position: of the device along the shaft, zero at the scene's start [m].
            roll: of the device about the shaft [rad].
            pulls: of the wires [N]; none when not given.
            wheels: wire that the wheels have taken up [m]; steers instead of `pulls` when given.

        Returns:
            Force and torque of the device's user on the shaft; what the user feels is the opposite.
        """
        data = self.engine.data
        self._ahead += self.period
        if self._ahead >= self._step * (1 - 1e-9):
            # The backend's hand aims at where the device is; a control is a speed, so as to get there in one step.
            rates = (np.array([position, roll]) - data.act[:2]) / self._step
            before = data.qvel[:2].copy()
            inputs = Controls(float(rates[0]), float(rates[1]), np.zeros(4) if pulls is None else pulls, wheels)
            self.engine.step(inputs, 1)
            self._acceleration = (data.qvel[:2] - before) / self._step
            self._ahead -= self._step
        speed = data.qvel[:2] + self._ahead * self._acceleration
        shaft = data.qpos[:2] + self._ahead * (data.qvel[:2] + speed) / 2
        force, torque = hand_force(np, np.array([position, roll]), shaft, speed, self._force_limits)
        return float(force), float(torque)


_AXES = ("push", "roll")
