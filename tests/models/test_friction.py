"""Friction between scope and wall is Coulomb's: it holds up to mu N, then resists with mu N at any speed.

Sources: Coulomb's law; Euler and Eytelwein's capstan equation, which a tether pulled through an ex-vivo colon follows
(Ortega Alcaide 2020).
"""

import mujoco
import numpy as np
import pytest

from haustra.models.contact import WallContact, apply_contact

GRAVITY = 9.81
RADIUS = 0.0064


def slider(tilt: float, friction: float, *, timestep: float = 0.005) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A body of 0.1 kg that does not turn, at rest on a soft wall that is tilted about y by `tilt` [rad]."""
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep
    spec.option.gravity = [GRAVITY * np.sin(tilt), 0, -GRAVITY * np.cos(tilt)]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    body = spec.worldbody.add_body(name="body", pos=[0, 0, RADIUS])
    for name, axis in zip("xyz", np.eye(3), strict=True):
        body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    body.add_geom(name="ball", type=sphere, size=[RADIUS, 0, 0], mass=0.1, contype=0, conaffinity=1)
    contact = WallContact(stiffness=1500.0, damping=7.5, friction=friction)
    apply_contact(spec, spec.compile(), ["ball"], contact, timestep=timestep)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[5, 1, 0.05], pos=[0, 0, -0.05], conaffinity=0)
    model = spec.compile()
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("friction", [0.03, 0.1, 0.3])
def test_a_body_starts_to_slide_at_the_angle_of_friction_within_half_a_degree(friction):
    limit, half_degree = np.arctan(friction), np.radians(0.5)
    speeds = []
    for tilt in (limit - half_degree, limit + half_degree):
        model, data = slider(tilt, friction)
        mujoco.mj_step(model, data, 1000)
        speeds.append(data.qvel[0])
    free = 5.0 * GRAVITY * (np.sin(limit + half_degree) - friction * np.cos(limit + half_degree))
    assert speeds[0] < 0.002  # it creeps, 200 times slower than it slides one degree further
    assert speeds[1] == pytest.approx(free, rel=0.05)


@pytest.mark.parametrize(("friction", "speed"), [(0.1, 0.5), (0.1, 0.1), (0.3, 0.1)])
def test_a_sliding_body_stops_after_v_squared_over_2_mu_g(friction, speed):
    """Faster, MuJoCo's cone first throws it up: at 0.5 m/s and 0.3 it stops 3 % short."""
    model, data = slider(0.0, friction, timestep=0.001)
    mujoco.mj_step(model, data, 1000)
    start = data.qpos[0]
    data.qvel[0] = speed
    mujoco.mj_step(model, data, int(2.0 / model.opt.timestep))
    assert data.qvel[0] < 1e-4
    first_step = 0.5 * speed * model.opt.timestep  # what semi-implicit steps leave out
    assert data.qpos[0] - start + first_step == pytest.approx(speed**2 / (2 * friction * GRAVITY), rel=0.01)


CELL, ROPE, DRUM = 0.003, 0.002, 0.030
"""Length of a link, radius of the rope, and of what it is bent round [m]."""


def rope_round_a_bend(turn: float, friction: float) -> float:
    """Pull over hold of a rope without stiffness that is drawn round a drum through an angle `turn` [rad]."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = 0.001
    spec.option.gravity = [0, 0, 0]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    around = DRUM + ROPE
    straight, bent = 8, round(turn * around / CELL)
    # Drawn along +x from its first link, which touches the drum's top; the rest lies round it.
    parent = spec.worldbody.add_body(name="link_0", pos=[straight * CELL, 0, around])
    parent.add_joint(name="pull", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0])
    names = []
    count = 2 * straight + bent
    for index in range(count):
        name = f"ball_{index}"
        parent.add_geom(
            name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[ROPE, 0, 0], mass=1e-3, contype=0, conaffinity=1
        )
        names.append(name)
        angle = turn / bent if straight <= index < straight + bent else 0.0
        parent = parent.add_body(name=f"link_{index + 1}", pos=[-CELL, 0, 0])
        parent.quat = [np.cos(angle / 2), 0, -np.sin(angle / 2), 0]
        hinge = parent.add_joint(name=f"hinge_{index}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
        hinge.damping = [1e-5, 0, 0]
    parent.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[ROPE, 0, 0], mass=1e-3, contype=0, conaffinity=0)
    contact = WallContact(stiffness=1500.0, damping=7.5, friction=friction)
    apply_contact(spec, spec.compile(), names, contact, timestep=0.001)
    drum = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[DRUM, 0.05, 0], conaffinity=0)
    drum.quat = [np.sqrt(0.5), np.sqrt(0.5), 0, 0]
    model = spec.compile()
    data = mujoco.MjData(model)
    speed, grip, hold = 0.02, 200.0, 1.0
    pulled = model.joint("pull").dofadr[0]
    model.dof_damping[pulled] = grip  # a hand that draws at that speed, whatever resists
    last = model.body(f"link_{count}").id
    pulls = []
    mujoco.mj_kinematics(model, data)
    data.xfrc_applied[last, :3] = -hold * data.xmat[last].reshape(3, 3)[:, 0]
    for step in range(1200):
        data.qfrc_applied[pulled] = grip * speed
        mujoco.mj_step(model, data)
        if step >= 600:
            pulls.append(grip * (speed - data.qvel[pulled]))
    return float(np.mean(pulls)) / hold


@pytest.mark.parametrize(("turn", "friction"), [(np.pi / 2, 0.1), (np.pi / 2, 0.3), (np.pi, 0.1)])
def test_a_rope_round_a_bend_follows_the_capstan_equation(turn, friction):
    assert rope_round_a_bend(turn, friction) == pytest.approx(np.exp(friction * turn), rel=0.03)
