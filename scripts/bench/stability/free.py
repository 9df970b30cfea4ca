"""Rods in empty space: energy, momentum, and the same motion in other units."""

from dataclasses import replace

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.sim.energy import EnergyMeter
from haustra.models.devices.scope.rods import RodModel, UniformRod, hinge_rod
from haustra.scripts.bench.result import Criterion

ROD = UniformRod(
    length=0.6,
    radius=0.0064,
    flexural_rigidity=0.033,
    torsional_rigidity=0.435,
    mass_per_length=0.3,
    relaxation_time=0.03,
)
"""A stretch of an adult scope's shaft."""
JOINTS, TWIST_HINGES = 12, 2
TIMESTEP = 0.005
"""As in scenes [s]."""
SECONDS = 2.0
BEND = 0.1
"""Angle of every bending hinge at the start [rad]: 69 degrees in all."""
ENERGY_GAIN = 1e-3
"""A passive rod may gain this share of what it started with within a step: it turns with semi-implicit Euler."""
MOMENTUM_DRIFT = 5e-4
SCALING = 1e-7
"""Same motion in other units: rounding only, grown over the steps."""
LAUNCH = np.array([0.2, 0.1, 0.3])
"""Velocity of a free rod [m/s]."""


def free_bars() -> tuple[Criterion, ...]:
    """Energy of a held and of a free rod, momentum of a free one, and scaled units."""
    held, _ = energies_and_momenta(ROD, free=False)
    loose, _ = energies_and_momenta(ROD, free=True)
    return (
        Criterion("energy that a held, released rod gains, of what it had", gain(held), ENERGY_GAIN, "1", "at most"),
        Criterion("energy that a free, unbending rod gains, of what it had", gain(loose), ENERGY_GAIN, "1", "at most"),
        Criterion(
            "drift of the momentum of a free, unbending rod",
            momentum_drift(ROD, TIMESTEP),
            MOMENTUM_DRIFT,
            "1",
            "at most",
        ),
        Criterion(
            "the same rod, armature and all, at the same time step by Runge and Kutta",
            momentum_drift(ROD, TIMESTEP, integrator=mujoco.mjtIntegrator.mjINT_RK4),
            MOMENTUM_DRIFT,
            "1",
            "at most",
        ),
        Criterion("tip of a rod in other units, of its length", scaled_difference(ROD), SCALING, "1", "at most"),
    )


def momentum_drift(
    rod: UniformRod,
    timestep: float,
    *,
    integrator: mujoco.mjtIntegrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    armature: bool = True,
) -> float:
    """Largest change of a free, unbending rod's momentum, over the momentum it was launched with.

    Armature belongs to single joints and carries no momentum of its own: without it the drift is the same.
    """
    _, momenta = energies_and_momenta(
        rod, free=True, timestep=timestep, damped_for=timestep, integrator=integrator, armature=armature
    )
    return float(np.linalg.norm(momenta - momenta[0], axis=1).max() / np.linalg.norm(momenta[0]))


def gain(energies: Float[np.ndarray, " steps"]) -> float:
    """Largest rise above the least energy until then, over what there was at the start; 0 when it only falls."""
    return float((energies - np.minimum.accumulate(energies)).max() / energies[0])


def energies_and_momenta(
    rod: UniformRod,
    *,
    free: bool,
    timestep: float = TIMESTEP,
    damped_for: float | None = TIMESTEP,
    integrator: mujoco.mjtIntegrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    armature: bool = True,
) -> tuple[Float[np.ndarray, " steps"], Float[np.ndarray, "steps 3"]]:
    """Mechanical energy [J] and linear momentum [N s] of a bent rod that is let go.

    Args:
        rod: the rod.
        free: floating and launched, instead of clamped at one end.
        timestep: time step [s].
        damped_for: time step that damping and armature are made for [s]; None for the rod's own damping alone.
        integrator: MuJoCo's; scenes use the default.
        armature: False to take it out again, leaving the damping.
    """
    model, data = _bent(hinge_rod(rod, JOINTS, twist_hinges=TWIST_HINGES, timestep=damped_for), free, timestep)
    model.opt.integrator = integrator
    if not armature:
        model.dof_armature[:] = 0.0
    meter = EnergyMeter(model, wall_stiffness=0.0)
    energies, momenta = [], []
    momentum = np.zeros(model.nv)
    for _ in range(round(SECONDS / timestep)):
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        mujoco.mj_mulM(model, data, momentum, data.qvel)
        stored = meter.read(data)
        energies.append(stored.total + stored.twist + 0.5 * float(data.qvel @ momentum))
        momenta.append(data.subtree_linvel[1] * model.body_subtreemass[1])
        mujoco.mj_step(model, data)
    return np.array(energies), np.array(momenta)


def scaled_difference(rod: UniformRod, *, length: float = 2.5, mass: float = 7.0, time: float = 0.4) -> float:
    """How far the tip of a rod in other units of length, mass and time is from the same place, over its length."""
    force = mass * length / time**2
    other = replace(
        rod,
        length=rod.length * length,
        radius=rod.radius * length,
        flexural_rigidity=rod.flexural_rigidity * force * length**2,
        torsional_rigidity=rod.torsional_rigidity * force * length**2,
        mass_per_length=rod.mass_per_length * mass / length,
        relaxation_time=rod.relaxation_time * time,
    )
    paths = []
    for each, unit, step in ((rod, 1.0, TIMESTEP), (other, length, TIMESTEP * time)):
        built = hinge_rod(each, JOINTS, twist_hinges=TWIST_HINGES, timestep=step)
        model, data = _bent(built, False, step)
        body, place = model.body(built.tip[0]).id, np.array(built.tip[1])
        path = []
        for _ in range(round(SECONDS / TIMESTEP)):
            mujoco.mj_step(model, data)
            path.append((data.xpos[body] + data.xmat[body].reshape(3, 3) @ place) / unit)
        paths.append(np.array(path))
    return float(np.linalg.norm(paths[0] - paths[1], axis=1).max() / rod.length)


def _bent(built: RodModel, free: bool, timestep: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = built.spec
    if free:
        spec.body("scope/root").add_freejoint(name="free")
    option = spec.option
    option.timestep, option.gravity = timestep, [0, 0, 0]
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_AUTORESET
    model = spec.compile()
    data = mujoco.MjData(model)
    for joint in range(model.njnt):
        if model.joint(joint).name.startswith("scope/bend_x"):
            data.qpos[model.jnt_qposadr[joint]] = BEND
    if free:
        data.qvel[:3] = LAUNCH
    return model, data
