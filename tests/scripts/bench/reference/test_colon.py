"""The paper's quasi-static equilibrium is where the dynamic scope comes to rest."""

import mujoco
import numpy as np
import pytest

from haustra.envs.control.follower import LumenFollower
from haustra.envs.runs.measure.progress import ArcTracker
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.scripts.bench.reference.colon import settle
from tests.bent_colon import bent_colon
from tests.tube_colon import straight_tube, wedge_wall

WHERE = ("straight tube", "bent tube")


@pytest.fixture(scope="module", params=WHERE)
def resting(request) -> tuple[str, NativeEngine]:
    """An adult scope at rest without friction: its tip pulled against a straight tube, or lying round a bend."""
    if request.param == "straight tube":
        options = SceneOptions(friction=0.0, start_depth=0.2, insertion_limit=0.3)
        backend = NativeEngine(build_scene(straight_tube(), wedge_wall(), named_design("adult"), options))
        pulls = np.zeros(4)
        for _ in range(100):
            assert backend.step(Controls(0.04, 0.0, pulls), 5)
        pulls = np.array([30.0, 9.0, 0.0, 0.0])
    else:
        colon, wall = bent_colon([(0.08, 0.0), (0.2, 2.5), (0.12, 0.0)])
        backend = NativeEngine(build_scene(colon, wall, named_design("adult"), SceneOptions(friction=0.0)))
        pulls = drive_to(backend, 0.33)
    # The search counts every piece that presses, as stock MuJoCo does; the backend counts the deepest of a place only.
    assert backend.step(Controls(0.0, 0.0, pulls), 1)
    for _ in range(1500):
        mujoco.mj_step(backend.model, backend.data, 5)
        if backend.data.time > 1 and np.abs(backend.data.qvel).max() < 1e-4:
            break
    assert np.abs(backend.data.qvel).max() < 1e-3
    return request.param, backend


def drive_to(backend: NativeEngine, arc: float) -> np.ndarray:
    """Let the follower bring the tip to an arc length; the pulls that it left."""
    scene = backend.scene
    tracker = ArcTracker(scene.colon.centreline, start=scene.options.start_depth)
    tip_links = scene.cable.tip_links
    driver, inputs = LumenFollower(scene.colon.centreline, scene.design, tip_links=tip_links), None
    while tracker.arc < arc and backend.data.time < 30:
        inputs = driver.act(backend.read(), tracker.arc, 0.02)
        assert backend.step(inputs, 4)
        tracker.update(backend.read().tip)
    assert inputs and tracker.arc >= arc
    return inputs.pulls


@pytest.mark.parametrize(
    "feedback", [2.0, *(pytest.param(more, marks=pytest.mark.thorough) for more in (5.0, 10.0, 15.0))]
)
def test_it_is_where_the_dynamic_scope_rests(resting, feedback, compare):
    where, backend = resting
    rest, shape = backend.data.qpos.copy(), backend.shape()
    dynamic = backend.read().energies
    assert dynamic.wall > 0
    # Start elsewhere, but inside the lumen: the scope a little straighter.
    backend.data.qpos[2:] *= 0.5 if where == "straight tube" else 0.96
    mujoco.mj_kinematics(backend.model, backend.data)
    moved = np.linalg.norm(backend.shape() - shape, axis=1).max()
    assert moved > 0.01
    found = settle(backend, feedback=feedback)
    gap = np.linalg.norm(backend.shape() - shape, axis=1).max()
    what = f"quasi-static scope in a {where}, eta = {feedback:.0f} k"
    took = f"{found.iterations} contact searches, {found.newton_steps} Newton steps, {found.seconds * 1e3:.0f} ms"
    compare(f"{what} ({took}): gap to the dynamic one [m]", gap, 0.0, within=1e-3, scale=1)
    compare(f"{what}: E_c [J]", found.bending_energy, dynamic.bending, within=0.02)
    compare(f"{what}: E_b [J]", found.wall_energy, dynamic.wall, within=0.05)
    backend.data.qpos[:] = rest
    mujoco.mj_forward(backend.model, backend.data)
