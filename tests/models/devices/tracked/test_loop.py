"""The treads around the struts: they carry the robot where the tips do not reach, and over seams of the wall."""

import mujoco
import numpy as np
import pytest

from haustra.models.device_scene import build_device_scene, device_options
from haustra.models.devices.base import load_device
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign
from haustra.models.devices.tracked.interface import TrackedRobot
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
    assert len(tracked.loops) == 5 * TRACKS
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    ramp = next(part for part in tracked.loops if part.track == 0 and part.geom.endswith("loop0front"))
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


@pytest.mark.parametrize("name", ["tracked", "tracked-far"])
@pytest.mark.parametrize("folded", [0.0, 0.5, 1.0])
def test_a_tread_leaves_the_core_at_its_end_at_every_width(name: str, folded: float) -> None:
    """Else a folded robot's bare end would run against the wall of bends, which its treads are to climb.

    Nor does any part of a tread stand further out than the straight way from the core's end to the tip.
    """
    robot = load_device(name)
    assert isinstance(robot, TrackedRobot)
    design, options = robot.design, device_options(robot)
    scene = build_device_scene(robot, options)
    model = scene.compile()
    data = mujoco.MjData(model)
    for track in range(TRACKS):
        data.qpos[model.joint(f"tracked/strut{track}").qposadr[0]] = folded * design.stroke[0]
    mujoco.mj_kinematics(model, data)
    core = data.body("tracked/core")
    end, ball = design.core_length / 2 + design.core_diameter / 4, design.tread.width / 2
    tip = (design.tread.tip_spacing / 2, design.nominal_diameter / 2 + folded * design.stroke[0])
    ends = set()
    for number, track in enumerate(robot._layout[1]):
        place = core.xmat.reshape(3, 3).T @ (data.geom(f"wall/sphere_{number:04d}").xpos - core.xpos)
        forwards, outwards = abs(place[0]), np.hypot(place[1], place[2])
        if track < 0 or forwards < tip[0]:
            continue
        way = np.interp(forwards, [tip[0], end], [tip[1], design.core_diameter / 2 + ball])
        assert outwards + ball < way + 5e-4  # pads stand out by how far they give
        if forwards > end - 1e-4 and outwards + ball >= design.core_diameter / 2:
            ends.add((int(track), bool(place[0] > 0)))
    assert len(ends) == 2 * TRACKS
