"""The tracked robot driven through a colon: how far it comes, and what it presses and pulls."""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float
from mujoco import rollout

from haustra.envs.engine.log import log_to_stderr_only
from haustra.envs.measure.propulsion import SETTLING, Outcome
from haustra.models.anatomy.colon import Colon
from haustra.models.scene import add_wall
from haustra.models.tracked.design import TRACKS, TrackedDesign
from haustra.models.tracked.device import Tracked
from haustra.models.tracked.rig import TIMESTEP, empty_spec
from haustra.models.tracked.standing import stand_in_colon, wall_near
from haustra.models.wall.wall import Wall

_LARGEST_SPEED = 1e3
"""A speed [m/s, rad/s] beyond this is divergence, not motion."""
_LEASH_STIFFNESS = 500.0
"""Of the string that holds the robot [N/m]: it gives 0.4 mm at the 1:1 device's pull."""
_LEASH_DAMPING = 1.0
"""[N s/m]."""


_FOLLOWED = 0.03
"""How far along the centreline the nearest station may move between two looks [m]: above any drive, below a loop."""


@dataclass(frozen=True)
class Drive:
    """A run in a colon. Forces are read after `SETTLING`."""

    outcome: Outcome
    time: Float[np.ndarray, " steps"]
    """[s]."""
    core: Float[np.ndarray, "steps 3"]
    """Centre of the core [m]."""
    axis: Float[np.ndarray, "3"]
    """Unit vector along the core at the end, forwards."""
    arc: Float[np.ndarray, "2"]
    """Arc length at the start and at the end [m]."""
    normal: Float[np.ndarray, "steps tracks"]
    """Normal force of each track on the wall [N]."""
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
    timestep: float = TIMESTEP,
) -> Drive:
    """Stand the robot in a colon, run its treads, and record. The whole run is one native call.

    Args:
        colon: The colon.
        wall: Its wall; only pieces within the robot's reach are used.
        design: The robot, at the scale it has in the patient.
        arc: Arc length of the core's centre at the start [m].
        friction: Coulomb's coefficient between treads and wall.
        speed: Of the treads relative to the core [m/s].
        seconds: Simulated time, more than `SETTLING` [s].
        held: Tie the robot to where it starts: the string's tension is what it could pull there.
        timestep: [s].

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
    model = spec.compile()
    tracked.set_speed(model, speed)
    states, sensors = _roll(model, tracked, speed, round(seconds / timestep))
    return _read(model, tracked, colon, arc, states, sensors, held=held)


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


def _roll(model: mujoco.MjModel, tracked: Tracked, speed: float, steps: int) -> tuple[np.ndarray, np.ndarray]:
    controls = np.zeros((1, steps, model.nu))
    pads = [model.actuator(pad.actuator).id for pad in tracked.pads]
    controls[0][:, pads] = tracked.phase_controls(speed * model.opt.timestep * np.arange(steps))
    data = mujoco.MjData(model)
    start = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, start, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    states, sensors = rollout.rollout(model, data, start[None], controls)
    return states[0], sensors[0]


def _read(model, tracked: Tracked, colon: Colon, arc: float, states, sensors, *, held: bool) -> Drive:
    finite = np.isfinite(states).all() and np.isfinite(sensors).all()
    speeds = states[:, 1 + model.nq : 1 + model.nq + model.nv]
    sound = bool(finite and np.abs(speeds).max() < _LARGEST_SPEED)
    pose = 1 + int(model.joint("tracked/free").qposadr[0])
    core = states[:, pose : pose + 3]
    axis = np.empty(3)
    mujoco.mju_rotVecQuat(axis, np.array([1.0, 0.0, 0.0]), np.ascontiguousarray(states[-1, pose + 3 : pose + 7]))
    normal = np.zeros((len(states), TRACKS))
    for pad in tracked.pads:
        address = model.sensor(pad.contact).adr[0]
        normal[:, pad.track] += sensors[:, address] + sensors[:, address + 3]
    tension = np.zeros(len(states))
    if held:
        length = sensors[:, model.sensor("leash").adr[0]]
        tension = _LEASH_STIFFNESS * np.maximum(length - tracked.design.core_length, 0.0)
    return Drive(
        outcome="completed" if sound else "diverged",
        time=states[:, 0],
        core=core,
        axis=axis,
        arc=_travel(colon, arc, core) if sound else np.array([arc, arc]),
        normal=normal,
        leash=tension,
    )


def _travel(colon: Colon, arc: float, core: np.ndarray) -> Float[np.ndarray, "2"]:
    """Arc length after the first step and at the end [m]: the nearest station, followed all along.

    Following it keeps the robot from being counted into a loop that touches from the other side.
    """
    line, passed = colon.centreline, [arc]
    for point in [*core[:: max(1, len(core) // 100)], core[-1]]:
        near = np.flatnonzero(np.abs(line.arc - passed[-1]) <= _FOLLOWED)
        passed.append(float(line.arc[near[np.argmin(np.linalg.norm(line.points[near] - point, axis=1))]]))
    return np.array([passed[1], passed[-1]])


def settled(drive: Drive) -> slice:
    """The steps after settling."""
    return slice(int(np.searchsorted(drive.time, SETTLING)), None)
