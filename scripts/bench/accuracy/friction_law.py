"""What is left of Coulomb's law in MuJoCo's contacts: creep, pressing while sliding, stopping; by impratio and damping.

Run it as `python -m haustra.scripts.bench.accuracy.friction_law`; docs/decisions/contact.md holds what it prints.
"""

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from haustra.models.wall.law import SLIP_RELAXATION, SLIP_SPEED, WallContact, contact_parameters, solimp

LAW = WallContact(stiffness=1500.0, damping=7.5, friction=0.0)
TIMESTEP, RADIUS, MASS = 0.005, 0.0064, 0.05
SPEED = 0.05
"""At which a body slides [m/s]."""


@dataclass(frozen=True)
class Coulomb:
    """How far one realisation is from Coulomb's law, for one load and coefficient."""

    creep: float
    """Speed under half of what friction can hold, over half the slip speed [1]."""
    inflation: float
    """Normal force while sliding, less what the depth says [N]."""
    late: float
    """How much farther than v^2 m / (2 mu F) a body slides before it stops [m]."""


def coulomb(load: float, friction: float, *, impratio: float, relaxation: float) -> Coulomb:
    """Press a body onto a plane by `load` [N], with that impratio and share of a slip taken away in a step."""
    model = _body(load, friction, impratio, relaxation)
    limit = friction * load
    creep = _run(model, load, pull=0.5 * limit).qvel[0]
    slid = _run(model, load, speed=SPEED, pull=limit, seconds=0.3)
    inflation = load + LAW.stiffness * slid.qpos[2]
    stopped = _run(model, load, speed=SPEED, seconds=2.0)
    far = stopped.qpos[0] + 0.5 * SPEED * TIMESTEP  # what semi-implicit steps leave out
    return Coulomb(float(creep) / (0.5 * SLIP_SPEED), float(inflation), float(far - MASS * SPEED**2 / (2 * limit)))


def _body(load: float, friction: float, impratio: float, relaxation: float) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    option = spec.option
    option.timestep, option.gravity, option.impratio, option.tolerance = TIMESTEP, [0, 0, 0], impratio, 1e-12
    option.integrator, option.cone = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, mujoco.mjtCone.mjCONE_ELLIPTIC
    body = spec.worldbody.add_body(pos=[0, 0, RADIUS])
    for axis in np.eye(3):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    sphere, plane = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_PLANE
    body.add_geom(name="ball", type=sphere, size=[RADIUS, 0, 0], mass=MASS, contype=0, conaffinity=0)
    spec.worldbody.add_geom(name="wall", type=plane, size=[1, 1, 1], contype=0, conaffinity=0)
    soft = contact_parameters(1 / MASS, replace(LAW, friction=friction), timestep=TIMESTEP, where="ball")
    spec.add_pair(
        geomname1="wall",
        geomname2="ball",
        condim=3,
        friction=[friction, friction, 0, 0, 0],
        solref=soft.solref,
        solreffriction=soft.sliding * relaxation / SLIP_RELAXATION,
        solimp=solimp(float(soft.impedance)),
    )
    return spec.compile()


def _run(
    model: mujoco.MjModel, load: float, *, speed: float = 0.0, pull: float = 0.0, seconds: float = 1.0
) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[2], data.qvel[0] = -load / LAW.stiffness, speed
    data.qfrc_applied[:] = [pull, 0.0, -load]
    mujoco.mj_step(model, data, round(seconds / TIMESTEP))
    return data


def main() -> None:
    """Print the table."""
    print("| impratio | relaxation | mu | load | creep / v_s | pressed harder | stops late |")
    print("|---|---|---|---|---|---|---|")
    for impratio, relaxation in ((10.0, 1.0), (100 / 3, 0.3), (100.0, 1.0), (1000 / 3, 0.3), (1000.0, 0.1)):
        for friction in (0.1, 0.3):
            for load in (1.0, 10.0):
                found = coulomb(load, friction, impratio=impratio, relaxation=relaxation)
                numbers = f"{found.creep:.2f} | {found.inflation:.3f} N | {1e3 * found.late:.2f} mm"
                print(f"| {impratio:.0f} | {relaxation:g} | {friction:g} | {load:g} N | {numbers} |")


if __name__ == "__main__":
    main()
