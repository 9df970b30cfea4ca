"""The paper's quasi-static equilibrium is where the dynamic scope comes to rest."""

import mujoco
import numpy as np
import pytest

from haustra.envs.engine.native import Inputs, NativeEngine
from haustra.envs.statics.colon import settle
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.scope.library import named_design
from tests.tube_colon import straight_tube, wedge_wall


@pytest.fixture(scope="module")
def bent():
    """An adult scope 0.28 m into a straight tube, its tip pulled against the wall, at rest, without friction."""
    options = SceneOptions(friction=0.0, start_depth=0.2, insertion_limit=0.3)
    engine = NativeEngine(build_scene(straight_tube(), wedge_wall(), named_design("adult"), options))
    for push, pull, intervals in ((0.04, 0.0, 100), (0.0, 30.0, 50), (0.0, 30.0, 700)):
        for _ in range(intervals):
            inputs = Inputs(push_rate=push, roll_rate=0.0, pulls=np.array([pull, 0.3 * pull, 0, 0]))
            assert engine.step(inputs, 5)
    assert np.abs(engine.data.qvel).max() < 1e-3
    return engine


@pytest.mark.parametrize("feedback", [2.0, 5.0, 10.0, 15.0])
def test_it_is_where_the_dynamic_scope_rests(bent, feedback, compare):
    rest, shape = bent.data.qpos.copy(), bent.shape()
    dynamic = bent.observe().energies
    assert dynamic.wall > 0
    # Start elsewhere: the scope straightened half-way.
    bent.data.qpos[2:] *= 0.5
    found = settle(bent, feedback=feedback)
    gap = np.linalg.norm(bent.shape() - shape, axis=1).max()
    what = f"quasi-static scope in a tube, eta = {feedback:.0f} k"
    took = f"{found.iterations} contact searches, {found.newton_steps} Newton steps, {found.seconds * 1e3:.0f} ms"
    compare(f"{what} ({took}): gap to the dynamic one [m]", gap, 0.0, within=1e-3, scale=1)
    compare(f"{what}: E_c [J]", found.bending_energy, dynamic.bending, within=0.02)
    compare(f"{what}: E_b [J]", found.wall_energy, dynamic.wall, within=0.05)
    bent.data.qpos[:] = rest
    mujoco.mj_forward(bent.model, bent.data)
