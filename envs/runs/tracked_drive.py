"""The tracked robot stepped among pieces of a wall, each tread at a speed of its own."""

import math

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco import rollout

from haustra.envs.runs.measure.progress import ArcTracker
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.tracked.design import TRACKS
from haustra.models.devices.tracked.device import Tracked
from haustra.models.devices.tracked.drive import WormState

CONTROL_INTERVAL = 0.02
"""Time between two looks at where the robot is [s], as of the scope's driver."""
_LARGEST_SPEED = 1e3
"""A speed [m/s, rad/s] beyond this is divergence, not motion."""


class TrackedRun:
    """A model being stepped, one native call a control interval, and what is kept of it."""

    def __init__(self, model: mujoco.MjModel, tracked: Tracked, colon: Colon, arc: float, speed: float) -> None:
        """Begin with the robot at an arc length [m]; `speed` is that of its treads [m/s]."""
        self.model, self.tracked, self.speed = model, tracked, speed
        self.shares = np.ones(TRACKS)
        self.tracker = ArcTracker(colon.centreline, start=arc)
        self._data = mujoco.MjData(model)
        self._state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
        mujoco.mj_getState(model, self._data, self._state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self._pose = 1 + int(model.joint("tracked/free").qposadr[0])
        self._struts = [1 + int(model.joint(f"tracked/strut{track}").qposadr[0]) for track in range(TRACKS)]
        self._pads = [model.actuator(pad.actuator).id for pad in tracked.pads]
        # Two contacts a sensor, three numbers each, the normal force first.
        contacts = [(pad.track, pad.contact) for pad in tracked.pads]
        contacts += [(part.track, part.geom) for part in tracked.loops]
        self._normals = np.zeros((model.nsensordata, TRACKS))
        for track, name in contacts:
            address = model.sensor(name).adr[0]
            self._normals[[address, address + 3], track] = 1
        self._core_sensor = model.sensor(tracked.core).adr[0]
        self._travel = np.zeros(TRACKS)
        self._roll = model.actuator(tracked.roll_motor).id
        self._track_of = np.full(model.ngeom, -1)
        for part in (*tracked.pads, *tracked.loops):
            self._track_of[model.geom(part.geom).id] = part.track
        self._friction = float(model.geom_friction[model.geom(tracked.pads[0].geom).id, 0])
        self._worm = WormState()
        self.tracker.update(self.pose()[0])
        self._latest = np.zeros(TRACKS), 0.0, np.zeros(TRACKS)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self._state[0])

    def pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Position and frame (forwards, left, up) of the core."""
        frame = np.empty(9)
        quaternion = np.ascontiguousarray(self._state[self._pose + 3 : self._pose + 7])
        mujoco.mju_quat2Mat(frame, quaternion)
        return self._state[self._pose : self._pose + 3].copy(), frame.reshape(3, 3)

    def advance(self, interval: float) -> bool:
        """Step on; False when the run has diverged."""
        model, step = self.model, self.model.opt.timestep
        steps = max(1, round(interval / step))
        worm, design = self._worm, self.tracked.design
        speeds = self.speed * self.shares * worm.speed_share
        self.tracked.set_speeds(model, speeds)
        turning = float(np.abs(speeds).max()) / design.worm.lead * math.tau
        self.tracked.set_friction(model, self._friction * design.shaft.transmission(turning))
        controls = np.zeros((1, steps, model.nu))
        controls[0][:, self._pads] = self.tracked.phase_controls_each(
            self._travel + speeds * step * np.arange(steps)[:, None]
        )
        controls[0][:, self._roll] = worm.torque
        warm = self._data.qacc_warmstart.copy()[None]
        states, sensors = rollout.rollout(model, self._data, self._state[None], controls, initial_warmstart=warm)
        states, sensors = states[0], sensors[0]
        self._travel = self._travel + speeds * step * steps
        self._state = states[-1].copy()
        core = sensors[:, self._core_sensor] + sensors[:, self._core_sensor + 3]
        normal = (sensors @ self._normals).mean(axis=0)
        self._latest = normal, float(core.mean()), states[-1, self._struts]
        rates = states[:, 1 + model.nq : 1 + model.nq + model.nv]
        sound = bool(np.isfinite(states).all() and np.isfinite(sensors).all() and np.abs(rates).max() < _LARGEST_SPEED)
        if sound:
            self._worm = WormState.under(design, self._traction())
            self.tracker.update(self.pose()[0])
        return sound

    def _traction(self) -> float:
        """Friction of the wall on all treads along the core, as of the last step [N]; forwards is positive."""
        data, forwards, total = self._data, self.pose()[1][:, 0], 0.0
        force = np.zeros(6)
        for number in range(data.ncon):
            contact = data.contact[number]
            first, second = self._track_of[contact.geom]
            if first < 0 and second < 0:
                continue
            mujoco.mj_contactForce(self.model, data, number, force)
            along = contact.frame.reshape(3, 3)[1:] @ forwards @ force[1:3]
            total += float(along if second >= 0 else -along)  # MuJoCo's force is that on the second
        return total

    def latest(self) -> tuple[Float[np.ndarray, " tracks"], float, Float[np.ndarray, " tracks"]]:
        """Mean force of each track and of the core over the last interval [N], and where the struts are [m]."""
        return self._latest
