"""A scope in a wall of tangent planes: it moves as in a wall of pieces, and the planes carry its forces."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene, usual_segment_stiffness
from tests.tube_colon import RADIUS, straight_tube, wedge_wall


def test_a_scope_slides_in_a_tube_and_its_steered_tip_presses_the_wall():
    colon = straight_tube()
    options = SceneOptions(wall_law="planes", insertion_limit=0.3, friction=0.0)
    engine = NativeEngine(build_scene(colon, wedge_wall(), named_design("adult"), options, show_lumen=False))
    assert engine.model.nmesh == 0
    for _ in range(120):
        assert engine.step(Controls(0.2, 0.0), 2)
    assert engine.read().insertion == pytest.approx(0.27, abs=0.01)
    for _ in range(60):
        assert engine.step(Controls(0.0, 0.0, np.array([20.0, 0.0, 0.0, 0.0])), 4)
    seen = engine.read()
    assert seen.link_forces.max() > 0.5
    depth = np.hypot(*engine.shape()[:-1, :2].T).max() + engine.scene.cable.radius - RADIUS
    assert depth < seen.link_forces.max() / options.wall_stiffness + 0.001


def pressed(options: SceneOptions) -> tuple[float, float, float]:
    """Depth of the deepest place [m], its force [N] and the wall's energy [J] when the tip is steered into a tube."""
    colon = straight_tube()
    engine = NativeEngine(build_scene(colon, None, named_design("adult"), options, show_lumen=False))
    for _ in range(120):
        assert engine.step(Controls(0.2, 0.0), 2)
    for _ in range(80):
        assert engine.step(Controls(0.0, 0.0, np.array([20.0, 0.0, 0.0, 0.0])), 4)
    depth = engine.data.contact.includemargin - engine.data.contact.dist
    deepest = int(depth.argmax())
    force = engine.data.efc_force[engine.data.contact.efc_address[deepest]]
    return float(depth[deepest]), float(force), engine.read().energies.wall


def test_each_segment_pushes_back_with_its_own_stiffness():
    """The tube is rectum to 0.3 m and sigmoid beyond; the pressed tip ends at 0.27 m. F = K d, E = F d / 2."""
    common = SceneOptions(wall_law="planes", insertion_limit=0.3, friction=0.0)
    for rectum, sigmoid in ((700.0, 2400.0), (2400.0, 700.0)):
        options = replace(common, segment_stiffness=(("rectum", rectum), ("sigmoid", sigmoid)))
        depth, force, energy = pressed(options)
        assert force == pytest.approx(rectum * depth, rel=0.05)  # what still moves is damped
        assert energy >= 0.5 * rectum * depth**2 * 0.99
    engine = NativeEngine(
        build_scene(
            straight_tube(), None, named_design("adult"), replace(options, insertion_limit=0.5), show_lumen=False
        )
    )
    for _ in range(220):
        assert engine.step(Controls(0.2, 0.0), 2)
    for _ in range(80):
        assert engine.step(Controls(0.0, 0.0, np.array([20.0, 0.0, 0.0, 0.0])), 4)
    contact = engine.data.contact
    place = contact.pos[:, 2]
    force = engine.data.efc_force[contact.efc_address]
    touching = force > 0.2
    assert (place[touching] > 0.31).any()
    expected = np.where(place > 0.3, 700.0, 2400.0) * (contact.includemargin - contact.dist)
    clear = touching & (np.abs(place - 0.3) > 0.01)
    np.testing.assert_allclose(force[clear], expected[clear], rtol=0.05)


def test_stiffness_by_segment_is_refused_where_it_cannot_be_had():
    with pytest.raises(InvalidOptionError, match="planes"):
        SceneOptions(segment_stiffness=(("rectum", 900.0),))
    options = SceneOptions(wall_law="planes", insertion_limit=0.3, segment_stiffness=(("appendix", 900.0),))
    with pytest.raises(InvalidOptionError, match="There are rectum, sigmoid"):
        NativeEngine(build_scene(straight_tube(), None, named_design("adult"), options, show_lumen=False))


def test_the_usual_stiffness_names_every_segment_within_what_was_measured():
    usual = dict(usual_segment_stiffness())
    assert tuple(usual) == SEGMENTS
    assert all(700 <= value <= 2400 for value in usual.values())
