"""What the robot pulls behind it: the scope's own drag in a straight lumen, the capstan's law round a bend."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from haustra.envs.runs.measure.towing import tow_force
from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.library import named_design
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.devices.tracked.device import Tracked
from haustra.models.devices.tracked.standing import stand_in_colon
from haustra.models.devices.tracked.towing import arc_ahead_of, tow_scope
from haustra.models.scene import Scene, SceneOptions, build_scene
from tests.ring_wall import bent_colon, ring_wall
from tests.tube_colon import straight_tube, wedge_wall

STEP = 2e-3
DRAG = 0.08
"""Force that holds the shaft back at the anus [N]; the 1:1 device pulls some 0.2 N."""


def limp_shaft():
    """A rod of next to no stiffness, so that only friction turns the force."""
    adult = named_design("adult")
    soft = {"flexural_rigidity": 1e-5, "torsional_rigidity": 1e-4}
    return replace(
        adult,
        diameter=0.004,
        mass_per_length=0.1,
        shaft=(replace(adult.shaft[0], length=0.7, **soft),),
        bending=replace(adult.bending, length=0.05, **soft),
        wires=replace(adult.wires, routing_radius=0.001),
        working_length=None,
    )


def pull(scene: Scene, tracked: Tracked, joint: str, seconds: float, speed: float):
    """The state at the end and the towing force at every step; a constant force holds the shaft back."""
    model = scene.spec.compile()
    model.actuator("scope/push").forcerange[:] = [-DRAG, -DRAG]
    tracked.set_speed(model, speed)
    data = mujoco.MjData(model)
    pads = [model.actuator(pad.actuator).id for pad in tracked.pads]
    forces = []
    for control in tracked.phase_controls(speed * STEP * np.arange(round(seconds / STEP))):
        data.ctrl[pads] = control
        mujoco.mj_step(model, data)
        forces.append(tow_force(model, data, joint))
    return data, np.array(forces)


def robot_before(scene: Scene, design: TrackedDesign) -> tuple[Tracked, str]:
    arc = arc_ahead_of(scene.options.start_depth, design)
    tracked = stand_in_colon(scene.spec, scene.colon, design, arc=arc, friction=0.4)
    return tracked, tow_scope(scene.spec, tracked, "scope/tip")


def test_in_a_straight_lumen_it_pulls_what_holds_the_scope_back() -> None:
    options = SceneOptions(timestep=STEP, insertion_limit=0.2)
    scene = build_scene(straight_tube(), wedge_wall(), named_design("adult"), options)
    tracked, joint = robot_before(scene, TrackedDesign().at_scale(1.2))
    data, forces = pull(scene, tracked, joint, 2.0, 0.01)
    assert forces[-400:, 2].mean() == pytest.approx(DRAG, rel=0.05)
    assert data.joint("scope/push").qpos[0] == pytest.approx(0.02, abs=0.006)
    assert data.site("scope/tip").xpos == pytest.approx(data.site(tracked.tow).xpos, abs=2e-4)


def test_round_a_bend_the_drag_grows_as_the_capstan_says() -> None:
    """Euler-Eytelwein: the force grows by e^(mu theta), theta being the angle that the shaft turns on the wall."""
    friction = 0.2
    colon = bent_colon(bend=0.06)
    wall = ring_wall(colon)
    options = SceneOptions(
        softening=False,
        timestep=STEP,
        shaft_cell=0.014,
        bending_cell=0.014,
        twist_hinges=0,
        friction=friction,
        insertion_limit=0.28,
    )
    scene = build_scene(colon, wall, limp_shaft(), options, show_lumen=False)
    tracked, joint = robot_before(scene, TrackedDesign().at_scale(1.0))
    data, forces = pull(scene, tracked, joint, 4.6, 0.05)
    force = forces[-250:].mean(0)
    links = np.array([data.body(link).xpos for link in scene.cable.links])
    inside = int(np.flatnonzero(links[:, 2] < 0.005)[-1])
    leaves = links[inside + 1] - links[inside]
    turned = np.arccos(force @ leaves / np.linalg.norm(force) / np.linalg.norm(leaves))
    assert turned > np.radians(50)
    assert np.linalg.norm(force) / DRAG == pytest.approx(np.exp(friction * turned), rel=0.04)


def test_what_cannot_be_towed_is_named() -> None:
    design = TrackedDesign().at_scale(1.1)
    scene = build_scene(straight_tube(), wedge_wall(), named_design("adult"), SceneOptions(timestep=STEP))
    tracked = stand_in_colon(scene.spec, straight_tube(), design, arc=0.3, friction=0.4)
    with pytest.raises(InvalidOptionError, match="no site 'nowhere'"):
        tow_scope(scene.spec, tracked, "nowhere")
    with pytest.raises(InvalidOptionError, match=r"'scope/tip' is 24\d.\d mm from the robot's rear"):
        tow_scope(scene.spec, tracked, "scope/tip")
