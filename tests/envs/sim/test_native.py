import numpy as np
import pytest

from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.tube_colon import straight_tube, wedge_wall

STILL = Controls(push_rate=0.0, roll_rate=0.0, pulls=np.zeros(4))


def engine_in_a_tube(**options) -> NativeEngine:
    return NativeEngine(build_scene(straight_tube(), wedge_wall(), named_design("adult"), SceneOptions(**options)))


def push(engine: NativeEngine, seconds: float, **changes) -> None:
    inputs = Controls(**{"push_rate": 0.05, "roll_rate": 0.0, "pulls": np.zeros(4), **changes})
    for _ in range(int(seconds / 0.02)):
        assert engine.step(inputs, round(0.02 / engine.model.opt.timestep))


def test_a_free_scope_goes_in_as_far_as_it_is_pushed():
    engine = engine_in_a_tube()
    push(engine, 4.0)
    seen = engine.read()
    assert seen.insertion == pytest.approx(0.03 + 0.2, abs=0.002)
    np.testing.assert_allclose(seen.tip, [0, 0, 0.23], atol=0.002)
    assert abs(seen.push_force) < 0.1


def test_the_same_inputs_give_the_same_run_to_the_bit():
    states = []
    for _ in range(2):
        engine = engine_in_a_tube()
        push(engine, 2.0, pulls=np.array([10.0, 0.0, 0.0, 0.0]), roll_rate=0.3)
        states.append(engine.data.qpos.copy())
    np.testing.assert_array_equal(*states)


def test_wall_forces_balance_the_tip_that_leans_on_them():
    engine = engine_in_a_tube()
    push(engine, 5.0)
    push(engine, 4.0, push_rate=0.0, pulls=np.array([15.0, 0.0, 0.0, 0.0]))
    seen = engine.read()
    assert seen.contacts > 0
    assert seen.link_forces.max() > 0.2
    # The wall holds the axis within the tube's radius less the scope's, plus the Hookean depth.
    depth = seen.link_forces.max() / engine.scene.options.wall_stiffness
    joints = engine.shape()[:-1]
    inside = joints[joints[:, 2] > 0]
    assert np.linalg.norm(inside[:, :2], axis=1).max() < 0.02 - 0.0064 + depth + 0.001


def test_joints_outside_the_patient_stay_straight_under_push():
    engine = engine_in_a_tube()
    push(engine, 1.0)
    engine.data.xfrc_applied[engine.model.body("scope/root").id, 0] = 0.0
    outside = engine.insertion < engine.scene.cable.length - engine.scene.cable.joint_positions
    names = [f"scope/bend_{axis}_{index:03d}" for index in np.flatnonzero(outside)[:-1] for axis in "xy"]
    angles = [engine.data.joint(name).qpos[0] for name in names]
    assert np.abs(angles).max() < 1e-3


@pytest.mark.parametrize("value", [np.nan, 1e30])
def test_a_broken_state_is_reported_as_diverged(value):
    engine = engine_in_a_tube()
    engine.data.qvel[5] = value
    assert not engine.step(STILL, 5)


def test_an_unstable_setting_is_reported_and_not_reset():
    engine = engine_in_a_tube()
    engine.model.dof_damping[2:] = 0.0
    engine.model.dof_armature[2:] = 0.0
    engine.model.jnt_stiffness[2:] *= 1e6
    engine.data.qpos[10] = 0.3
    healthy = True
    for _ in range(200):
        healthy = healthy and engine.step(STILL, 5)
    assert not healthy
