"""The tracked robot driven through a colon: how far it comes, what it presses and pulls, and what stops it."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco import rollout

from haustra.envs.control.tracked_steering import AxisSteering
from haustra.envs.runs.device_run import DeviceRun
from haustra.envs.runs.measure.containment import Containment
from haustra.envs.runs.measure.progress import ArcTracker
from haustra.envs.runs.measure.propulsion import SETTLING, Outcome
from haustra.envs.runs.outcome import Outcome as Outcomes
from haustra.envs.sim.log import log_to_stderr_only
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.lumen_meshes import add_lumen
from haustra.models.devices.base import Device
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign
from haustra.models.devices.tracked.device import Tracked
from haustra.models.devices.tracked.drive import WormState
from haustra.models.devices.tracked.interface import TrackedRobot
from haustra.models.devices.tracked.rig import TIMESTEP, empty_spec
from haustra.models.devices.tracked.standing import (
    require_fit,
    stand_in_colon,
    track_radii,
    wall_near,
    where_it_fits,
)
from haustra.models.scene import add_wall
from haustra.models.wall.pieces.wall import Wall

EndedBy = Literal["time", "end of colon", "too narrow", "too wide", "blocked", "stalled", "slips", "diverged"]
"""Why a drive ended. Its time was up, or it came to the caecum; or it stood still because: a strut is folded to its
stop; half of its tracks do not reach the wall; its core lies against the wall;
its worm is asked for more torque than its shaft transmits; none of these, so its treads slip."""
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
_STALLED = 0.5
"""Of the worm's speed asked for, below which its torque limit is what holds the robot back."""
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
    worm_torque: Float[np.ndarray, " looks"]
    """What the treads ask of the worm, zero at the start [N m]: it turns the core, and is limited by the shaft."""
    worm_share: Float[np.ndarray, " looks"]
    """Speed of the worm over the speed asked for [1]: less than 1 where its torque limit holds it back."""


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
        self._roll = model.actuator(tracked.roll_motor).id
        self._track_of = np.full(model.ngeom, -1)
        for part in (*tracked.pads, *tracked.loops):
            self._track_of[model.geom(part.geom).id] = part.track
        self._friction = float(model.geom_friction[model.geom(tracked.pads[0].geom).id, 0])
        self._worms = [WormState()]
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
        worm, design = self._worms[-1], self.tracked.design
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
            self._worms.append(WormState.under(design, self._traction()))
            self._arcs.append(self.tracker.update(self.pose()[0]))
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

    @property
    def worm(self) -> WormState:
        """What the worm does."""
        return self._worms[-1]

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
            worm_torque=np.array([worm.torque for worm in self._worms]),
            worm_share=np.array([worm.speed_share for worm in self._worms]),
        )


_OUTCOMES = {"time": Outcomes.TIME_UP, "end of colon": Outcomes.REACHED_CAECUM, "diverged": Outcomes.DIVERGED}
_ADVICE = {
    "time": "it was still on its way: give --seconds more",
    "end of colon": "it came to the caecum",
    "too narrow": "a strut is folded to its stop: give a smaller at_scale",
    "too wide": "half of the tracks do not reach the wall: give a larger at_scale",
    "blocked": "the core's end stands against the wall: try steering = 'each tread'",
    "slips": "the treads slip: raise the friction or the bellows' force",
    "stalled": "the worm's torque limit holds it: raise design.worm.torque_limit or lower the friction",
    "diverged": "the step was too long for these forces",
}
"""What stopped the robot, and what to do."""
_HELD = 3.0
"""How long it pulls at the string [s]: the pull is steady after some tenths."""
_USUAL_START = 0.3
"""Where the robot stands at first [m]."""


def run_tracked(
    device: Device,
    colon: Colon,
    wall: Wall,
    *,
    seconds: float,
    arc: float | None = None,
    friction: float | None = None,
    progress: Progress | None = None,
) -> DeviceRun:
    """Stand a tracked robot in a colon, drive it, then hold it by a string to see what it could pull there.

    Args:
        device: the robot.
        colon: the colon.
        wall: its wall of pieces.
        seconds: simulated time [s].
        arc: where its centre stands at first [m from the anus].
        friction: between treads and wall; the device's own when None.
        progress: told after each control interval.

    Raises:
        InvalidOptionError: when a value cannot be honoured.
        InvalidDesignError: when the robot does not fit there.
    """
    assert isinstance(device, TrackedRobot)
    if seconds <= SETTLING:
        raise InvalidOptionError(f"--seconds is {seconds}; a tracked robot needs more than {SETTLING} to settle.")
    design, arc = device.design, _USUAL_START if arc is None else arc
    friction = device.friction if friction is None else friction
    speed = design.tread_speed(device.rpm)
    require_fit(colon, design, arc)
    began = time.perf_counter()
    free, held = (
        drive_in_colon(
            colon,
            wall,
            design,
            arc=arc,
            friction=friction,
            speed=speed,
            seconds=min(seconds, _HELD) if tied else seconds,
            held=tied,
            steered=device.steering != "none",
            progress=None if tied else progress,
        )
        for tied in (False, True)
    )
    diverged = "diverged" in (free.outcome, held.outcome)
    spec = empty_spec(TIMESTEP)
    add_wall(spec, wall_near(wall, arc - 0.1, float(free.arc.max()) + 0.1))
    stand_in_colon(spec, colon, design, arc=arc, friction=friction)
    add_lumen(spec, colon, group=1)
    along = np.linspace(-0.5, 0.5, 25)[:, None] * design.core_length * free.axis
    return DeviceRun(
        device=device,
        outcome=Outcomes.DIVERGED if diverged else _OUTCOMES.get(free.ended_by, Outcomes.STUCK),
        records=_records(colon, design, free),
        shape=free.core[-1] + along,
        radius=design.smallest_diameter / 2,
        spec=spec,
        wall_clock=time.perf_counter() - began,
        backend="native",
        wall_law="pieces",
        left_out=device.left_out,
        configuration={
            "design": device.describe(),
            "left_out": dict(device.left_out),
            "wall": wall.method,
            "seconds": seconds,
            "start": arc,
            "friction": friction,
        },
        own_scores=_own_scores(colon, device, free, held, arc=arc, friction=friction) if not diverged else {},
    )


def _records(colon: Colon, design: TrackedDesign, drive: Drive) -> dict[str, np.ndarray]:
    """At every control interval."""
    ends = np.minimum(
        np.searchsorted(drive.time, CONTROL_INTERVAL * np.arange(1, len(drive.arc)) - 1e-9), len(drive.time) - 1
    )
    containment = Containment(colon, radius=design.core_diameter / 2)
    core, arcs = drive.core[ends], drive.arc[1:]
    outside = [containment.outside(place[None], np.zeros(1), float(arc)) for place, arc in zip(core, arcs, strict=True)]
    return {
        "time": drive.time[ends],
        "tip": core,
        "tip_arc": arcs,
        "wall_force": np.maximum(drive.normal[ends].max(axis=1), drive.core_force[ends]),
        "deepest": np.array(outside, float),
        "worm_torque": drive.worm_torque[1:],
        "worm_share": drive.worm_share[1:],
        "normal": drive.normal[ends].sum(axis=1),
        "core_force": drive.core_force[ends],
    }


def _own_scores(
    colon: Colon, device: TrackedRobot, free: Drive, held: Drive, *, arc: float, friction: float
) -> dict[str, object]:
    design = device.design
    fit = where_it_fits(colon, design)
    furthest = int(np.argmax(free.arc))
    moving = max(furthest, 1) * CONTROL_INTERVAL
    treads = design.tread_speed(device.rpm) * moving
    driven = float(free.arc[furthest] - free.arc[0])
    normal, pressed = free.normal[settled(free)], held.normal[settled(held)]
    pull, total = float(held.leash[settled(held)].mean()), float(pressed.sum(1).mean())
    last = int(np.searchsorted(free.time, free.time[-1] - 0.5))
    return {
        "ended_by": free.ended_by,
        "advice": _ADVICE[free.ended_by],
        "lumen_under_tracks_mm": (2e3 * track_radii(colon, design, arc)).tolist(),
        "reach_mm": [1e3 * design.smallest_diameter, 1e3 * design.largest_diameter],
        "fits_share_of_colon": fit.share,
        "fits_longest_m": [fit.start, fit.end],
        "driven_mm": 1e3 * driven,
        "moving_s": moving,
        "treads_ran_mm": 1e3 * treads,
        "driven_share": driven / treads if treads else 0.0,
        "speed_at_end_mm_s": 1e3
        * float(np.linalg.norm(free.core[-1] - free.core[last]) / (free.time[-1] - free.time[last])),
        "normal_per_track_N": normal.mean(0).tolist(),
        "normal_largest_N": float(normal.max()),
        "core_on_wall_N": float(free.core_force[settled(free)].mean()),
        "touching_share_per_track": (normal > 0).mean(0).tolist(),
        "pull_N": pull,
        "pull_over_mu_normal": pull / (friction * total) if friction * total > 0 else 0.0,
        "held_worm_torque_peak_Nm": float(held.worm_torque.max()),
        "held_worm_share_least": float(held.worm_share.min()),
        "worm_torque_limit_Nm": design.worm.torque_limit,
    }


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
    if run.worm.speed_share < _STALLED:
        return "stalled"
    return "slips"
