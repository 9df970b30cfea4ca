"""The treads around the struts: they carry the robot where the tips do not reach, and over seams of the wall."""

import mujoco
import numpy as np
import pytest

from haustra.models.devices.tracked.design import TRACKS, TrackedDesign
from haustra.models.devices.tracked.rig import empty_spec
from haustra.models.devices.tracked.standing import stand_in_colon
from haustra.models.scene import add_wall
from tests.tube_colon import straight_tube, wedge_wall

DESIGN = TrackedDesign().at_scale(1.2)
FRICTION = 0.4
SPEED = 0.01


@pytest.mark.parametrize("timestep", [1e-3, 2e-3])
def test_in_the_seams_of_a_wall_it_pulls_all_that_friction_gives(timestep: float) -> None:
    """F = mu N with every pad in a seam between two flat pieces, at the default step and at twice that."""
    spec = empty_spec(timestep)
    add_wall(spec, wedge_wall())
    tracked = stand_in_colon(spec, straight_tube(), DESIGN, arc=0.3, friction=FRICTION)
    model = spec.compile()
    tracked.set_speed(model, SPEED)
    data = mujoco.MjData(model)
    pads = [model.actuator(pad.actuator).id for pad in tracked.pads]
    core = model.joint("tracked/free").dofadr[0]
    ratios = []
    for control in tracked.phase_controls(SPEED * timestep * np.arange(round(1.0 / timestep))):
        data.ctrl[pads] = control
        pull = 200 * (data.qpos[:3] - [0, 0, 0.3]) + 2 * data.qvel[core : core + 3]
        data.qfrc_applied[core : core + 3] = -pull
        mujoco.mj_step(model, data)
        normal = sum(data.sensordata[model.sensor(pad.contact).adr[0] + k] for pad in tracked.pads for k in (0, 3))
        ratios.append(pull[2] / (FRICTION * normal) if normal > 0 else 0.0)
    assert np.mean(ratios[len(ratios) // 2 :]) == pytest.approx(1.0, abs=0.01)


def test_a_ramp_at_the_core_pulls_it_on() -> None:
    """A wall that only a front ramp touches drives the robot forwards: the tread runs backwards there too."""
    spec = empty_spec(1e-3)
    tracked = stand_in_colon(spec, straight_tube(), DESIGN, arc=0.3, friction=FRICTION)
    assert len(tracked.loops) == 3 * TRACKS
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    ramp = next(part for part in tracked.loops if part.track == 0 and part.geom.endswith("front"))
    centre = data.geom(ramp.geom).xpos
    outwards = data.geom(ramp.geom).xmat.reshape(3, 3)
    across = outwards[:, 0] if abs(outwards[2, 0]) > 0.1 else outwards[:, 1]
    across = across * np.sign(across @ (centre - [0, 0, centre[2]]))
    spec.worldbody.add_geom(
        name="wall",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[0.004, 0, 0],
        pos=centre + across * (DESIGN.tread.width / 2 + 0.0039),
        contype=1,
        conaffinity=0,
    )
    model = spec.compile()
    tracked.set_speed(model, SPEED)
    data = mujoco.MjData(model)
    for _ in range(50):
        mujoco.mj_step(model, data)
    still = mujoco.MjData(model)
    tracked.set_speed(model, 0.0)
    for _ in range(50):
        mujoco.mj_step(model, still)
    core = model.joint("tracked/free").dofadr[0]
    assert data.qvel[core + 2] > still.qvel[core + 2] + 1e-3
