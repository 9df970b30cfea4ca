"""The tracked robot driven through a colon: how far it comes, what it presses and pulls, and what stops it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco import rollout

from haustra.envs.control.tracked_steering import AxisSteering
from haustra.envs.runs.measure.progress import ArcTracker
from haustra.envs.runs.measure.propulsion import SETTLING, Outcome
from haustra.envs.sim.log import log_to_stderr_only
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign
from haustra.models.devices.tracked.device import Tracked
from haustra.models.devices.tracked.rig import TIMESTEP, empty_spec
from haustra.models.devices.tracked.standing import stand_in_colon, wall_near
from haustra.models.scene import add_wall
from haustra.models.wall.pieces.wall import Wall

EndedBy = Literal["time", "end of colon", "too narrow", "too wide", "blocked", "slips", "diverged"]
"""Why a drive ended. Its time was up, or it came to the caecum; or it stood still because: a strut is folded to its
stop; half of its tracks do not reach the wall; its core lies against the wall; none of these, so its treads slip."""
Progress = Callable[[float, float], None]
"""Called with simulated time [s] and arc length [m]."""

CONTROL_INTERVAL = 0.02
"""Time between two looks at where the robot is [s], as of the scope's driver."""
PATIENCE = 4.0
"""It stands when it made less than `_HEADWAY` in this time [s]: at 150 rpm treads of the 1:1 device run 32 mm."""
_HEADWAY = 0.003
"""[m]; above the centreline's spacing of 2 mm."""
_LARGEST_SPEED = 1e3
"""A speed [m/s, rad/s] beyond this is divergence, not motion."""
_LEASH_STIFFNESS = 500.0
"""Of the string that holds the robot [N/m]: it gives 0.4 mm at the 1:1 device's pull."""
_LEASH_DAMPING = 1.0
"""[N s/m]."""
_FOLDED = 0.02
"""Of the stroke, within which a strut counts as folded to its stop."""
_BEARING = 0.05
"""Of the bellows' preload, below which a track counts as not reaching the wall."""


@dataclass(frozen=True)
class Drive:
    """A run in a colon. Forces are read after `SETTLING`."""

    outcome: Outcome
    ended_by: EndedBy
    time: Float[np.ndarray, " steps"]
    """[s]."""
    core: Float[np.ndarray, "steps 3"]
    """Centre of the core [m]."""
    axis: Float[np.ndarray, "3"]
    """Unit vector along the core at the end, forwards."""
    arc: Float[np.ndarray, " looks"]
    """Arc length of the core's centre at the start and after each `CONTROL_INTERVAL` [m]."""
    normal: Float[np.ndarray, "steps tracks"]
    """Normal force of each track on the wall, its tips and the rest of its tread [N]."""
    core_force: Float[np.ndarray, " steps"]
    """Normal force of the core on the wall [N]."""
    leash: Float[np.ndarray, " steps"]
    """Tension of the string that holds the robot [N]; zero when it is free."""


def drive_in_colon(
    colon: Colon,
    wall: Wall,
    design: TrackedDesign,
    *,
    arc: float,
    friction: float,
    speed: float,
    seconds: float,
    held: bool = False,
    steered: bool = False,
    timestep: float = TIMESTEP,
    progress: Progress | None = None,
) -> Drive:
    """Stand the robot in a colon, run its treads, and record until time is up or it stands.

    Args:
        colon: The colon.
        wall: Its wall; only pieces within the robot's reach are used.
        design: The robot, at the scale it has in the patient.
        arc: Arc length of the core's centre at the start [m].
        friction: Coulomb's coefficient between treads and wall.
        speed: Of the treads relative to the core [m/s].
        seconds: Simulated time, more than `SETTLING` [s].
        held: Tie the robot to where it starts: the string's tension is what it could pull there.
        steered: Let each tread have its own speed (`AxisSteering`); otherwise one worm drives all four.
        timestep: [s].
        progress: Told after each control interval.

    Raises:
        InvalidOptionError: when arc length, friction or time step cannot be honoured.
        InvalidDesignError: when the robot does not fit there.
    """
    log_to_stderr_only()
    spec = empty_spec(timestep)
    reach = design.core_length + design.largest_diameter
    add_wall(spec, wall_near(wall, arc - reach, arc + reach + speed * seconds))
    tracked = stand_in_colon(spec, colon, design, arc=arc, friction=friction)
    if held:
        _hold(spec, tracked)
    run = TrackedRun(spec.compile(), tracked, colon, arc, speed)
    steering = AxisSteering(colon.centreline, design) if steered else None
    end = colon.centreline.length - design.core_length / 2
    ended: EndedBy = "time"
    while run.time < seconds - timestep / 2:
        if steering:
            run.shares = steering.shares(*run.pose(), run.tracker.arc)
        if not run.advance(min(CONTROL_INTERVAL, seconds - run.time)):
            ended = "diverged"
        elif run.tracker.arc >= end - _HEADWAY:
            ended = "end of colon"
        elif not held and speed > 0 and run.stands():
            ended = _why_it_stands(run)
        if progress:
            progress(run.time, run.tracker.arc)
        if ended != "time":
            break
    return run.record(ended)


def settled(drive: Drive) -> slice:
    """The steps after settling."""
    return slice(int(np.searchsorted(drive.time, SETTLING)), None)


def _hold(spec: mujoco.MjSpec, tracked: Tracked) -> None:
    """A string from the robot's rear to a post a core's length behind it, taut from the start."""
    core, length = spec.body(tracked.core), tracked.design.core_length
    back = np.empty(3)
    mujoco.mju_rotVecQuat(back, np.array([1.0, 0.0, 0.0]), np.asarray(core.quat))
    rear = core.pos + back * spec.site(tracked.tow).pos[0]
    spec.worldbody.add_site(name="post", pos=rear - back * length)
    string = spec.add_tendon(
        name="leash",
        stiffness=[_LEASH_STIFFNESS, 0, 0],
        damping=[_LEASH_DAMPING, 0, 0],
        springlength=[0, length],
    )
    string.wrap_site("post")
    string.wrap_site(tracked.tow)
    spec.add_sensor(
        name="leash", type=mujoco.mjtSensor.mjSENS_TENDONPOS, objtype=mujoco.mjtObj.mjOBJ_TENDON, objname="leash"
    )


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
        self._leash = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, "leash")
        self._travel = np.zeros(TRACKS)
        self._arcs = [self.tracker.update(self.pose()[0])]
        self._kept: list[tuple[np.ndarray, ...]] = []

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
        speeds = self.speed * self.shares
        self.tracked.set_speeds(model, speeds)
        controls = np.zeros((1, steps, model.nu))
        controls[0][:, self._pads] = self.tracked.phase_controls_each(
            self._travel + speeds * step * np.arange(steps)[:, None]
        )
        warm = self._data.qacc_warmstart.copy()[None]
        states, sensors = rollout.rollout(model, self._data, self._state[None], controls, initial_warmstart=warm)
        states, sensors = states[0], sensors[0]
        self._travel = self._travel + speeds * step * steps
        self._state = states[-1].copy()
        core = sensors[:, self._core_sensor] + sensors[:, self._core_sensor + 3]
        self._kept.append(
            (
                states[:, 0],
                states[:, self._pose : self._pose + 3],
                sensors @ self._normals,
                core,
                sensors[:, model.sensor_adr[self._leash]] if self._leash >= 0 else np.zeros(steps),
                states[:, self._struts],
            )
        )
        rates = states[:, 1 + model.nq : 1 + model.nq + model.nv]
        sound = bool(np.isfinite(states).all() and np.isfinite(sensors).all() and np.abs(rates).max() < _LARGEST_SPEED)
        if sound:
            self._arcs.append(self.tracker.update(self.pose()[0]))
        return sound

    def stands(self) -> bool:
        """Whether it made no headway for `PATIENCE`."""
        looks = round(PATIENCE / CONTROL_INTERVAL)
        return len(self._arcs) > looks and max(self._arcs[-looks:]) - self._arcs[-looks - 1] < _HEADWAY

    def latest(self) -> tuple[Float[np.ndarray, " tracks"], float, Float[np.ndarray, " tracks"]]:
        """Mean force of each track and of the core over the last interval [N], and where the struts are [m]."""
        kept = self._kept[-1]
        return kept[2].mean(axis=0), float(kept[3].mean()), kept[5][-1]

    def last(self, which: int) -> np.ndarray:
        """One of the kept values over the last `PATIENCE`."""
        return np.concatenate([kept[which] for kept in self._kept[-round(PATIENCE / CONTROL_INTERVAL) :]])

    def record(self, ended: EndedBy) -> Drive:
        """All that was kept."""
        time, core, normal, core_force, leash, _ = (np.concatenate(values) for values in zip(*self._kept, strict=True))
        tension = np.zeros(len(time))
        if self._leash >= 0:
            tension = _LEASH_STIFFNESS * np.maximum(leash - self.tracked.design.core_length, 0.0)
        return Drive(
            outcome="diverged" if ended == "diverged" else "completed",
            ended_by=ended,
            time=time,
            core=core,
            axis=self.pose()[1][:, 0],
            arc=np.array(self._arcs),
            normal=normal,
            core_force=core_force,
            leash=tension,
        )


def _why_it_stands(run: TrackedRun) -> EndedBy:
    design = run.tracked.design
    low, high = design.stroke
    ranges = np.array([run.model.joint(f"tracked/strut{track}").range for track in range(TRACKS)])
    from_fold = run.last(5).mean(0) - ranges[:, 0]
    if (from_fold < _FOLDED * (high - low)).any():
        return "too narrow"
    if (run.last(2).mean(0) < _BEARING * design.bellows.preload).sum() >= TRACKS / 2:
        return "too wide"
    if run.last(3).mean() > _BEARING * design.bellows.preload:
        return "blocked"
    return "slips"
