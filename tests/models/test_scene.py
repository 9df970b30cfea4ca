from pathlib import Path

import mujoco
import numpy as np
import pytest

from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.errors import InvalidOptionError, OutputError
from haustra.models.devices.base import load_device
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import Scene, SceneOptions, build_scene
from haustra.models.wall.piece_wall import step_once
from tests.tube_colon import straight_tube, wedge_wall


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(straight_tube(), wedge_wall(), named_design("adult"))


def test_the_scope_weighs_what_its_modelled_length_weighs(scene):
    model = scene.compile()
    expected = scene.design.mass_per_length * scene.cable.length
    # The tip's cap stops its capsule one radius short of the end.
    assert model.body_mass.sum() == pytest.approx(
        expected, abs=scene.design.mass_per_length * scene.cable.radius * 1.01
    )


def test_only_scope_and_wall_touch(scene):
    model = scene.compile()
    scope = np.array([model.geom(f"wall/sphere_{number:04d}").id for number in range(len(scene.samples))])
    assert (model.geom_conaffinity[scope] == 1).all()
    assert (model.geom_contype[scope] == 0).all()
    others = np.setdiff1d(np.arange(model.ngeom), scope)
    assert (model.geom_conaffinity[others] == 0).all()


def _load(path: Path) -> mujoco.MjModel:
    if path.suffix == ".xml":
        return mujoco.MjModel.from_xml_path(str(path))
    with path.open("rb") as file:
        return mujoco.MjSpec.from_zip(file).compile()


@pytest.mark.parametrize("suffix", [".mjz", ".xml"])
def test_a_saved_scene_steps_to_the_same_trajectory(scene, tmp_path: Path, suffix):
    """To the bit, where what presses on one place counts once; within 0.5 mm in stock MuJoCo, where each piece does."""
    engine = NativeEngine(scene)
    inputs = Controls(push_rate=0.05, roll_rate=0.2, pulls=np.array([6.0, 2.0, 0.0, 0.0]))
    controls = []
    for _ in range(60):
        assert engine.step(inputs, 5)
        controls.append(engine.data.ctrl.copy())
    saved = scene.save(tmp_path / f"scene{suffix}")

    model = _load(saved)
    spheres = np.isin(
        np.arange(model.ngeom), [model.geom(f"wall/sphere_{i:04d}").id for i in range(len(scene.samples))]
    )
    same, stock = mujoco.MjData(model), mujoco.MjData(model)
    for control in controls:
        same.ctrl[:] = stock.ctrl[:] = control
        for _ in range(5):
            step_once(model, same, spheres)
        mujoco.mj_step(model, stock, 5)
    np.testing.assert_array_equal(same.qpos, engine.data.qpos)
    tips = [data.site("scope/tip").xpos for data in (stock, engine.data)]
    assert engine.data.ncon > 0 and np.linalg.norm(tips[0] - tips[1]) < 5e-4


def test_a_scene_of_another_kind_of_file_is_refused(scene, tmp_path):
    with pytest.raises(OutputError, match=r"use \.mjz or \.xml"):
        scene.save(tmp_path / "scene.usd")


@pytest.mark.parametrize(
    "change",
    [
        {"timestep": float("nan")},
        {"timestep": 0.5},
        {"shaft_cell": 0.0},
        {"gravity": (0.0, float("inf"), 0.0)},
        {"push_limit": -3.0},
    ],
)
def test_impossible_options_are_refused(change):
    with pytest.raises(InvalidOptionError):
        SceneOptions(**change)


def test_a_horizon_shorter_than_the_tip_is_refused():
    with pytest.raises(InvalidOptionError, match="insertion_limit"):
        build_scene(straight_tube(), wedge_wall(), named_design("adult"), SceneOptions(insertion_limit=0.05))


def test_spacing_follows_the_colon_when_a_largest_bend_is_given():
    colon, wall = straight_tube(), wedge_wall()
    even = build_scene(colon, wall, named_design("adult"))
    adapted = build_scene(colon, wall, named_design("adult"), SceneOptions(largest_bend_deg=20.0))
    # A straight tube asks for few joints: rods merge.
    assert len(adapted.cable.cells) < len(even.cable.cells)
    assert adapted.cable.length == pytest.approx(even.cable.length)


def test_a_scene_of_a_colon_and_a_name_is_what_the_command_line_builds() -> None:
    colon = straight_tube()
    moving = Scene.of(colon, "paediatric", friction=0.2, insertion_limit=0.2)
    assert (moving.options.wall_law, moving.options.mesentery, moving.options.friction) == ("table", True, 0.2)
    assert moving.design.name == "paediatric"
    assert Scene.of(colon, wall=wedge_wall(), insertion_limit=0.2).pieces
    with pytest.raises(InvalidOptionError, match="'capsule' is no scope"):
        Scene.of(colon, load_device("capsule"))
