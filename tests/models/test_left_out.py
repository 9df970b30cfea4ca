"""Shaft that stays outside and wall out of reach are left out, and nothing that is asked notices."""

import numpy as np
import pytest

from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.bent_colon import bent_colon

DEEPEST, RATE, SECONDS = 0.23, 0.05, 4.0
DESIGN = named_design("adult")


@pytest.fixture(scope="module")
def tube():
    return bent_colon([(0.1, 0.0), (0.12, 1.2), (0.62, 0.0)])


def _drive(scene) -> np.ndarray:
    """Tip, push force and torque at the handle, every 20 ms of a steered and turned insertion."""
    engine = NativeEngine(scene)
    rows = []
    while engine.data.time < SECONDS - 1e-9:
        pulls = np.array([0.0, 8.0 * min(1.0, engine.data.time), 0.0, 0.0])
        assert engine.step(Controls(RATE, 0.15, pulls), 4)
        seen = engine.read()
        rows.append((*seen.tip, seen.push_force, seen.torque))
    return np.array(rows)


def test_a_scene_without_what_it_cannot_reach_does_the_same(tube) -> None:
    """Bound of 0.2 % of the length inside for the tip, and of 0.3 % of the peaks for force and torque."""
    colon, wall = tube
    whole = build_scene(colon, wall, DESIGN, show_lumen=False)
    gone = build_scene(colon, wall, DESIGN, show_lumen=False, deepest=DEEPEST)
    assert gone.pieces < 0.6 * whole.pieces
    assert gone.compile().nv < 0.6 * whole.compile().nv
    assert {"shaft held outside", "wall out of reach"} <= gone.left_out.keys()
    first, second = _drive(whole), _drive(gone)
    assert np.linalg.norm(first[:, :3] - second[:, :3], axis=1).max() < 2e-3 * DEEPEST
    for column, least in ((3, 0.2), (4, 0.01)):
        late = np.abs(first[50:, column]).max(), np.abs(second[50:, column]).max()
        assert late[0] > least
        assert late[1] == pytest.approx(late[0], rel=3e-3)


def test_what_can_be_reached_stays(tube) -> None:
    colon, wall = tube
    whole = build_scene(colon, wall, DESIGN, show_lumen=False)
    deep = build_scene(colon, wall, DESIGN, show_lumen=False, deepest=5.0)
    assert deep.compile().nv == whole.compile().nv
    assert deep.pieces == whole.pieces == len(wall.pieces)
    assert "shaft held outside" not in deep.left_out


def test_under_gravity_the_shaft_outside_stays(tube) -> None:
    colon, wall = tube
    options = SceneOptions(gravity=(0.0, 0.0, -9.81))
    whole = build_scene(colon, wall, DESIGN, options, show_lumen=False)
    asked = build_scene(colon, wall, DESIGN, options, show_lumen=False, deepest=DEEPEST)
    assert asked.compile().nv == whole.compile().nv
