"""A scope in a wall of tangent planes: it moves as in a wall of pieces, and the planes carry its forces."""

import numpy as np
import pytest

from haustra.envs.engine.native import Inputs, NativeEngine
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.scope.library import named_design
from tests.tube_colon import RADIUS, straight_tube, wedge_wall


def test_a_scope_slides_in_a_tube_and_its_steered_tip_presses_the_wall():
    colon = straight_tube()
    options = SceneOptions(wall_law="planes", insertion_limit=0.3, friction=0.0)
    engine = NativeEngine(build_scene(colon, wedge_wall(), named_design("adult"), options, show_lumen=False))
    assert engine.model.nmesh == 0
    for _ in range(120):
        assert engine.step(Inputs(0.2, 0.0), 2)
    assert engine.observe().insertion == pytest.approx(0.27, abs=0.01)
    for _ in range(60):
        assert engine.step(Inputs(0.0, 0.0, np.array([20.0, 0.0, 0.0, 0.0])), 4)
    seen = engine.observe()
    assert seen.link_forces.max() > 0.5
    depth = np.hypot(*engine.shape()[:-1, :2].T).max() + engine.scene.cable.radius - RADIUS
    assert depth < seen.link_forces.max() / options.wall_stiffness + 0.001
