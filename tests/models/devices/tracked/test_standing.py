"""The tracked robot in a colon: it finds the wall and moves on."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from haustra.envs.sim.device_native import NativeDevice
from haustra.errors import InvalidDesignError, InvalidOptionError
from haustra.models.device_scene import build_device_scene, device_options, device_tables, pose_in
from haustra.models.devices.base import load_device
from haustra.models.devices.scope.library import named_design
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.devices.tracked.interface import TrackedRobot
from haustra.models.devices.tracked.standing import core_room, places_that_fit, require_fit, stand_in_colon, track_radii
from haustra.models.scene import SceneOptions, build_scene
from tests.ring_wall import bent_colon
from tests.tube_colon import RADIUS, straight_tube, wedge_wall

DESIGN = TrackedDesign().at_scale(1.1)
"""A tube of 40 mm is just wider than the 1:1 device reaches."""
STEP = 1e-3


def drive(spec: mujoco.MjSpec, tracked, seconds: float, speed: float):
    model = spec.compile()
    data = mujoco.MjData(model)
    tracked.set_speed(model, speed)
    pads = [model.actuator(pad.actuator).id for pad in tracked.pads]
    for control in tracked.phase_controls(speed * STEP * np.arange(round(seconds / STEP))):
        data.ctrl[pads] = control
        mujoco.mj_step(model, data)
    return model, data


def test_it_drives_through_a_colon_at_its_tread_speed() -> None:
    """Nothing holds it back, so the treads stick and the robot moves on as fast as they run."""
    scene = build_scene(straight_tube(), wedge_wall(), named_design("adult"), SceneOptions(timestep=STEP))
    tracked = stand_in_colon(scene.spec, straight_tube(), DESIGN, arc=0.3, friction=0.4)
    _, data = drive(scene.spec, tracked, 1.0, 0.01)
    assert data.body(tracked.core).xpos[2] > 0.305
    assert data.joint("tracked/free").qvel[2] == pytest.approx(0.01, rel=0.05)
    assert np.linalg.norm(data.body(tracked.core).xpos[:2]) < 1e-3


def test_in_a_colon_its_friction_is_as_stiff_as_it_asks_for() -> None:
    """The treads' friction saturates at the slowest tread speed with an impratio of 1e3; scopes ask for less."""
    scene = build_scene(straight_tube(), wedge_wall(), named_design("adult"), SceneOptions(insertion_limit=0.3))
    stand_in_colon(scene.spec, straight_tube(), DESIGN, arc=0.3, friction=0.4)
    assert scene.spec.option.impratio == 1e3


def test_each_track_spreads_to_the_wall_it_faces() -> None:
    colon = straight_tube()
    radius = colon.radius.copy()
    radius[:, : radius.shape[1] // 2] *= 0.9
    assert track_radii(replace(colon, radius=radius), DESIGN, 0.3) == pytest.approx(
        [0.9 * RADIUS, RADIUS, RADIUS, 0.9 * RADIUS]
    )


def test_places_that_do_not_fit_are_named() -> None:
    spec = mujoco.MjSpec()
    with pytest.raises(InvalidDesignError, match=r"straight tube.*40.0 and 40.0 mm wide.*99.6 to 151.6.*fits nowhere"):
        stand_in_colon(spec, straight_tube(), TrackedDesign(), arc=0.3, friction=0.4)
    with pytest.raises(InvalidDesignError, match=r"reach 12.\d to 1[89].\d mm.*fits nowhere"):
        stand_in_colon(spec, straight_tube(), TrackedDesign().at_scale(0.5), arc=0.3, friction=0.4)
    with pytest.raises(InvalidOptionError, match="cannot stand at 0 mm"):
        stand_in_colon(spec, straight_tube(), DESIGN, arc=0.0, friction=0.4)


def test_it_does_not_stand_where_the_lumen_turns_within_its_core() -> None:
    """A core of 46 mm across a right angle of 25 mm radius in a lumen of 26 mm would be in its wall."""
    colon, robot = bent_colon(bend=0.025, leg=0.12, length=0.36, radius=0.013), load_device("tracked-far")
    assert isinstance(robot, TrackedRobot)
    bend = 0.12 + 0.025 * np.pi / 4
    assert core_room(colon, robot.design, np.array([0.06]))[0] > 1e-3
    assert core_room(colon, robot.design, np.array([bend]))[0] < -1e-3
    with pytest.raises(InvalidDesignError, match=r"turns too sharply for a core of 45.8 mm.*nearest place that fits"):
        require_fit(colon, robot.design, bend)
    fits = places_that_fit(colon, robot.design, colon.centreline.arc[30:-30])
    gap = int(np.diff(fits).argmax())
    for arc in fits[gap : gap + 2]:  # next to the bend, where rounding might refuse
        for aside in (-1e-12, 0.0, 1e-12):
            robot.standing(colon, float(arc) + robot._nose + aside)
    nose = (robot.design.core_length + robot.design.core_diameter) / 2
    start = robot.nearest_start(colon, bend + nose)
    options = device_options(robot, start_depth=start)
    scene, pose = build_device_scene(robot, options), pose_in(colon, robot, options)
    backend = NativeDevice(scene, device_tables(scene, [colon], [pose]), starts=[pose.arc])
    backend.step(np.array([[0.0]]), 1)
    assert backend.read().deepest[0] > 0 and backend.readings()["core_force"][0] == 0.0
