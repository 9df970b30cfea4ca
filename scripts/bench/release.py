"""Tip releases: a cable let go from a held shape, stepped with second order in time, against a rod's data."""

import time
from dataclasses import dataclass, replace
from typing import Literal

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from haustra.errors import HaustraError, InvalidOptionError
from haustra.models.devices.scope.rods import RodModel, UniformRod, hinge_rod
from haustra.scripts.bench.reference.rod import static_shape
from haustra.scripts.bench.rod_data import RodRelease
from haustra.scripts.bench.statics import wrench_loads

TWIST_HINGES = 5
"""Twist hinges of a released rod; measured: the tip's error with 5 and with one a joint differ by 0.001 % of length."""

DEFAULT_STEP = 0.003
"""Time step where the rod's loss time allows it [s]; measured: error and real-time factor meet their criteria."""

_STABLE_PART = 0.9
"""Part of the loss time that a step may take; at 1.0 the scheme is at its limit of stability."""

Scheme = Literal["second order", "as in scenes"]
"""How time is stepped: accurate for free motion, or with the damping and armature that contact in scenes needs."""


@dataclass(frozen=True)
class ReleaseErrors:
    """How far a computed motion is from the data's."""

    file: str
    timestep: float
    """[s]."""
    time: Float[np.ndarray, " samples"]
    """The data's times [s]."""
    mid: Float[np.ndarray, "samples 3"]
    """Computed mid-length at those times [m]."""
    tip: Float[np.ndarray, "samples 3"]
    """Computed tip at those times [m]."""
    mid_rms: float
    """Root mean square distance over the recorded time, over length [1]."""
    tip_rms: float
    """Root mean square distance at the tip over the recorded time, over length [1]."""
    tip_mean: float
    """Mean distance at the tip over length [1]."""
    real_time_factor: float
    """Simulated time over the processor time that stepping took."""


def release_errors(
    rod: UniformRod,
    release: RodRelease,
    joints: int,
    *,
    timestep: float | None = None,
    scheme: Scheme = "second order",
) -> ReleaseErrors:
    """Hold the rod, let it go, and compare mid-length and tip with the data.

    Args:
        rod: the rod; its loss time is replaced by the release's.
        release: the data.
        joints: bending joints of the cable.
        timestep: time step [s]; `DEFAULT_STEP`, or as much as is stable, when None.
        scheme: how time is stepped.

    Raises:
        InvalidOptionError: when the time step is not positive, or too large for the scheme.
        HaustraError: when the motion diverges.
    """
    largest = _STABLE_PART * release.relaxation_time
    step = min(DEFAULT_STEP, largest) if timestep is None else timestep
    if not 0 < step <= (largest if scheme == "second order" else 0.1):
        raise InvalidOptionError(
            f"{release.file}: a time step of {step} s is not stable; give a positive one, at most {largest:.4f} s."
        )
    built, model, data = _held(replace(rod, relaxation_time=release.relaxation_time), release, joints, step, scheme)
    points = [(name, np.array(place)) for name, place, _ in (built.mid[0], (*built.tip, 1.0))]
    steps = int(np.ceil(release.time[-1] / step)) + 1
    track, spent = _step_through(model, data, points, steps, corrected=scheme == "second order")
    if not np.isfinite(track).all():
        raise HaustraError(f"{release.file}: the release diverged at a time step of {step} s: lower it.")
    mid, tip = (_sample(release.time, step, track[:, point]) for point in range(2))
    mid_error, tip_error = (
        np.linalg.norm(computed - known, axis=1) / rod.length
        for computed, known in ((mid, release.mid), (tip, release.tip))
    )
    return ReleaseErrors(
        file=release.file,
        timestep=step,
        time=release.time,
        mid=mid,
        tip=tip,
        mid_rms=float(np.sqrt((mid_error**2).mean())),
        tip_rms=float(np.sqrt((tip_error**2).mean())),
        tip_mean=float(tip_error.mean()),
        real_time_factor=float(release.time[-1] / spent),
    )


def _held(
    rod: UniformRod, release: RodRelease, joints: int, step: float, scheme: Scheme
) -> tuple[RodModel, mujoco.MjModel, mujoco.MjData]:
    """The rod in the equilibrium that it is let go from."""
    in_scenes = scheme == "as in scenes"
    built = hinge_rod(rod, joints, twist_hinges=min(joints, TWIST_HINGES), timestep=step if in_scenes else None)
    integrators = mujoco.mjtIntegrator
    option = built.spec.option
    option.timestep = step
    option.gravity = release.gravity
    option.integrator = integrators.mjINT_IMPLICITFAST if in_scenes else integrators.mjINT_EULER
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_AUTORESET
    model = built.spec.compile()
    data = mujoco.MjData(model)
    mid, tip = (release.mid_force, release.mid_moment), (release.tip_force, release.tip_moment)
    static_shape(model, data, loads=wrench_loads(model, built, mid=mid, tip=tip))
    return built, model, data


def _sample(
    times: Float[np.ndarray, " samples"], step: float, track: Float[np.ndarray, "steps 3"]
) -> Float[np.ndarray, "samples 3"]:
    # Straight lines between steps would cut corners by (omega h)^2 / 8, as much as the motion is off.
    return CubicSpline(np.arange(len(track)) * step, track)(times)


def _step_through(
    model: mujoco.MjModel, data: mujoco.MjData, points: list, steps: int, *, corrected: bool
) -> tuple[Float[np.ndarray, "steps points 3"], float]:
    """Positions of points at every step, and the processor time that took [s].

    MuJoCo's Euler step is a leapfrog: positions live on whole steps, velocities on half steps between them, and the
    spring force is of second order. Two things are not. A velocity of zero at the start belongs to time zero, not to
    half a step before it: it is moved there, v = -a h/2. And implicit damping acts with the velocity half a step
    later, C v(t + h/2): C a h/2 too much, where a is the acceleration; when `corrected`, that of the step before is
    added back.
    """
    step = model.opt.timestep
    damping = np.reshape(model.dof_damping, (model.nv, -1))[:, 0]
    lead = 0.5 * step * damping if corrected else np.zeros(model.nv)
    acceleration = np.zeros(model.nv)
    data.qvel[:] = 0
    if corrected:
        mujoco.mj_forward(model, data)
        acceleration = _implicit_acceleration(model, data, damping)
        data.qvel[:] = -0.5 * step * acceleration
    bodies = [model.body(name).id for name, _ in points]
    places = np.array([place for _, place in points])
    track = np.empty((steps, len(points), 3))
    began = time.process_time()
    for index in range(steps):
        before = data.qvel.copy()
        data.qfrc_applied[:] = lead * acceleration
        mujoco.mj_step(model, data)
        acceleration = (data.qvel - before) / step
        # Positions of bodies are still those at the start of the step.
        turns = data.xmat[bodies].reshape(-1, 3, 3)
        track[index] = data.xpos[bodies] + np.einsum("pij,pj->pi", turns, places)
    return track, time.process_time() - began


def _implicit_acceleration(
    model: mujoco.MjModel, data: mujoco.MjData, damping: Float[np.ndarray, " dofs"]
) -> Float[np.ndarray, " dofs"]:
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    return np.linalg.solve(inertia + model.opt.timestep * np.diag(damping), data.qfrc_smooth)
