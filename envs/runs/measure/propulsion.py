"""What a tracked robot pulls: runs on its rigs, and the force, ripple and torque read from them."""

from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco import rollout

from haustra.envs.sim.log import log_to_stderr_only
from haustra.models.devices.tracked.rig import Rig

Outcome = Literal["completed", "diverged"]

SETTLING = 0.5
"""Simulated time before anything is read [s]: the slowest motion, a strut on its bellows, settles within 0.2 s."""
READ = 1.0
"""Shortest time read [s]: the paper's third step; stretched to whole tooth passages."""
TOUCHING = 0.5
"""Least share of the time read for which every pad must touch. With friction 1 in a tube as wide as struts reach, a pad
lifts for 43 % of the time at any step from 0.2 to 1 ms, and the force does not change: motion. With too large a step
pads chatter, touch for less than a third of the time, and the force is wrong."""
_LARGEST_FORCE = 1e4
"""Force [N] beyond which a run counts as diverged: a thousand times the robot's own."""


@dataclass(frozen=True)
class Pull:
    """A steady run at one speed, and what is read from it."""

    outcome: Outcome
    """Diverged when a value is not finite or enormous, or when a pad is off the wall for half the time."""
    force: Float[np.ndarray, " steps"]
    """Propulsion: friction of all pads along the track [N]."""
    normal: Float[np.ndarray, " steps"]
    """Sum of all pads' normal forces [N]."""
    string: Float[np.ndarray, " steps"]
    """Tension of the string [N]; the friction itself on a fixed core."""
    roll: float
    """Mean roll rate of a free core about its axis [rad/s]."""
    tooth_frequency: float
    """Tread speed over pitch [Hz]."""
    touching: float
    """Share of the time for which the pad that lifts most touches the wall."""
    timestep: float
    """[s]."""

    @property
    def mean(self) -> float:
        """Mean propulsion force [N]."""
        return float(self.force.mean())

    def ripple(self, harmonics: int = 3) -> Float[np.ndarray, " harmonics"]:
        """Amplitudes of the propulsion force at the tooth-passing frequency and its multiples [N]."""
        return amplitudes(self.force, self.tooth_frequency * self.timestep, harmonics)


def amplitudes(
    signal: Float[np.ndarray, " steps"], frequency: float, harmonics: int
) -> Float[np.ndarray, " harmonics"]:
    """Amplitude of a signal at multiples of a frequency [1/step], by least squares with its mean."""
    angles = 2 * np.pi * frequency * np.arange(len(signal))[:, None] * np.arange(1, harmonics + 1)
    basis = np.concatenate([np.ones((len(signal), 1)), np.cos(angles), np.sin(angles)], axis=1)
    found = np.linalg.lstsq(basis, signal, rcond=None)[0][1:]
    return np.hypot(found[:harmonics], found[harmonics:])


def pull(rig: Rig, speed: float, *, roll_torque: float = 0.0) -> Pull:
    """Run the treads at a steady speed and read one second or more, after settling.

    The controls (tooth phase, worm torque) are known beforehand, so the whole run is one native call.

    Args:
        rig: From `flat_rig` or `tube_rig`.
        speed: Of the treads relative to the core [m/s].
        roll_torque: Of the flexible shaft on the core about its axis [N m]; needs a free core.
    """
    model = rig.spec.compile()
    rig.tracked.set_speed(model, speed)
    return pull_model(model, rig, speed, roll_torque=roll_torque)


def pull_model(model: mujoco.MjModel, rig: Rig, speed: float, *, roll_torque: float = 0.0) -> Pull:
    """Pull of the robot in a rig whose model is compiled and whose treads already run at that speed."""
    log_to_stderr_only()
    step = model.opt.timestep
    frequency = speed / rig.tracked.design.tread.pitch
    periods = max(1, np.ceil(READ * frequency)) if speed > 0 else 1
    read = round((periods / frequency if speed > 0 else READ) / step)
    settling = round(SETTLING / step)
    controls = np.zeros((settling + read, model.nu))
    travel = speed * step * np.arange(settling + read)
    controls[:, [model.actuator(pad.actuator).id for pad in rig.tracked.pads]] = rig.tracked.phase_controls(travel)
    if rig.tracked.roll_motor:
        controls[:, model.actuator(rig.tracked.roll_motor).id] = roll_torque
    data = mujoco.MjData(model)
    start = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    states, sensors = rollout.rollout(model, data, start[None], controls[None])
    return _read(model, rig, states[0, settling:], sensors[0, settling:], frequency)


def _read(model, rig: Rig, states, sensors, frequency: float) -> Pull:
    addresses = [model.sensor(pad.contact).adr[0] for pad in rig.tracked.pads]
    forces = np.stack([sensors[:, a : a + 6] for a in addresses], 1).reshape(len(sensors), -1, 2, 3)
    normal = forces[..., 0].sum((1, 2))
    # Friction opposes sliding, which is along the track but for a slow roll: its size is its axial part times 1/cos.
    friction = np.linalg.norm(forces[..., 1:], axis=-1).sum((1, 2))
    free = bool(rig.string)
    string = rig.tension(sensors[:, model.sensor(rig.string).adr[0]]) if free else friction
    roll = float(states[:, 1 + model.nq + 3].mean()) if free else 0.0
    finite = bool(np.isfinite(states).all() and np.isfinite(sensors).all() and np.abs(forces).max() < _LARGEST_FORCE)
    touching = float((forces[..., 0].sum(2) > 0).mean(0).min())
    sound = finite and touching >= TOUCHING
    return Pull(
        outcome="completed" if sound else "diverged",
        force=friction,
        normal=normal,
        string=string,
        roll=roll,
        tooth_frequency=frequency,
        touching=touching,
        timestep=float(model.opt.timestep),
    )
