"""Water in a run: it opens rectum and sigmoid, weighs on a colon that moves, alike on both backends."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.runs.measure.scores import score
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.growing import growing
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.accuracy import NOT_MEASURED
from haustra.models.anatomy.colon import Colon
from haustra.models.device_scene import build_device_scene, device_options
from haustra.models.devices.base import load_device
from haustra.models.scene import SceneOptions, entry_of
from haustra.models.wall import mesentery
from haustra.models.wall.abdomen import DOWN, Abdomen
from haustra.models.wall.lumen_table import lumen_table, stack
from haustra.provenance import Provenance
from haustra.scripts.run import Run
from tests.envs.sim.test_gas import OPTIONS, batch_of, colon, driven, gas_of, pushed, scene_of

__all__ = ["colon"]

MOVING = {"mesentery": True, "water": 4e-5}
STILL = Controls(0.0, 0.0)


def sunk(colon: Colon, backend, **changed) -> np.ndarray:
    """Displacement of the axis [m] after two seconds in which nobody moves the scope, in the colon's coordinates."""
    engine = backend(scene_of(colon, **{**MOVING, **changed}))
    for _ in range(100):
        assert engine.step(STILL, 4)
    return engine.read().displacement[:, :3]


def test_water_opens_rectum_and_sigmoid_and_nothing_else(colon: Colon):
    """As wide as the pressure at which it fits; without water that of the start, 12 mmHg."""
    gas, wall = gas_of(colon)
    wet, _ = gas_of(colon, water=2e-4)
    arcs = np.linspace(0, colon.centreline.length, len(wall))
    inside, behind = (arcs > 0.13) & (arcs < 0.27), arcs > 0.34
    assert (wet.widths[inside] > 1.1 * gas.widths[inside]).all()
    np.testing.assert_allclose(wet.widths[behind], gas.widths[behind], rtol=1e-2)
    assert wet.water.sum() == pytest.approx(2e-4) and wet.volume < gas.volume


@pytest.mark.parametrize(
    "around",
    # Prone differs from "left" in the direction alone.
    [Abdomen(), pytest.param(Abdomen("prone"), marks=pytest.mark.thorough), Abdomen("left")],
    ids=lambda one: one.posture,
)
def test_water_pulls_a_colon_down_as_the_patient_lies(colon: Colon, around: Abdomen):
    """More than without, where the weight of the wall itself may pull: none when supine, as it was imaged."""
    moved = sunk(colon, LinearSingle, abdomen=around) - sunk(colon, LinearSingle, abdomen=around, water=0.0)
    middle = moved[len(moved) // 4 : len(moved) // 2].mean(axis=0)
    assert middle @ np.array(DOWN[around.posture]) > 0.8 * np.linalg.norm(middle) > 1e-4


def test_both_backends_weigh_water_alike(colon: Colon):
    """To 2 % of the way that the colon sinks; a scope whose shaft is added on the way too."""
    linear = sunk(colon, LinearSingle)
    for backend in (NativeEngine, growing(None, deepest=1.0)):
        assert np.abs(sunk(colon, backend) - linear).max() < 0.02 * np.abs(linear).max()


def test_the_hand_of_one_scope_pours_water_in_that_weighs(colon: Colon):
    engine = LinearSingle(scene_of(colon, mesentery=True, start_depth=0.15))
    assert engine.gas is not None
    kept = engine.keep()
    engine.gas.pour(5e-6)
    for _ in range(100):
        assert engine.step(STILL, 4)
    assert engine.gas.water[1] == pytest.approx(1e-5, rel=0.06)
    after = engine.read().displacement
    assert after[:, 1].max() > 1e-5
    engine.put_back(kept, STILL)
    assert not engine.gas.water.any()
    engine.gas.pour(5e-6)
    for _ in range(100):
        assert engine.step(STILL, 4)
    np.testing.assert_array_equal(engine.read().displacement, after)


def moving_batch(colon: Colon, worlds: int, **changed) -> LinearBackend:
    scene = scene_of(colon, **{**MOVING, **changed})
    table = lumen_table(colon, device_radius=scene.cable.radius, with_mesentery=True).seen_from(*entry_of(colon))
    return LinearBackend(scene, stack([table]), worlds=worlds, real=np.float64)


def test_one_world_of_many_is_one_alone_and_each_has_water_of_its_own(colon: Colon):
    alone, many = moving_batch(colon, 1), moving_batch(colon, 3)
    assert many.gas is not None
    np.testing.assert_allclose(pushed(many, 1.0), np.tile(pushed(alone, 1.0), (3, 1)), atol=1e-9)
    many.gas.pouring = np.array([0.0, 0.0, 8e-6])
    pushed(many, 1.0)
    places = many.displacement
    assert places is not None and np.abs(places[2] - places[0]).max() > 1e-6
    np.testing.assert_array_equal(places[0], places[1])


def test_a_world_without_water_is_the_same_to_the_bit_where_water_could_weigh(colon: Colon):
    """Room for the weight of water in each world's own axis changes nothing while there is none."""
    with_room, without = moving_batch(colon, 2, water=1e-5), moving_batch(colon, 2, water=0.0)
    assert with_room.gas is not None
    with_room.gas._water = 0.0
    one, options = np.ones(2), with_room.scene.options
    plain = Conditions(options.friction * one, options.wall_stiffness * one, one)
    with_room.reset(np.arange(2), np.zeros(2, int), plain)
    np.testing.assert_array_equal(pushed(with_room, 1.0), pushed(without, 1.0))
    np.testing.assert_array_equal(with_room.displacement, without.displacement)


def test_scores_say_how_much_water_and_null_without(colon: Colon):
    kinds = {"provenance": Provenance(inputs={}, configuration={}), "error": NOT_MEASURED}
    wet, dry = (
        score(scene_of(colon, **changed), driven(colon, LinearSingle, **changed), **kinds)
        for changed in ({"water": 4e-5}, {})
    )
    assert wet["water_volume_mL"] == pytest.approx(40.0) and dry["water_volume_mL"] is None


def test_options_of_a_run_ask_for_water(tmp_path):
    run = Run(colon=tmp_path, output=tmp_path, insufflate="25mmHg", water="300mL")
    assert run._options()["water"] == pytest.approx(3e-4)
    with pytest.raises(InvalidOptionError, match="--insufflate"):
        Run(colon=tmp_path, output=tmp_path, water="300mL")._options()
    with pytest.raises(InvalidOptionError, match=r"'300mL' or '0\.3L'"):
        Run(colon=tmp_path, output=tmp_path, insufflate="25mmHg", water="300")._options()


def test_water_without_gas_too_much_of_it_and_other_devices_refuse_it(colon: Colon):
    with pytest.raises(InvalidOptionError, match="gas"):
        SceneOptions(wall_law="table", water=1e-4)
    with pytest.raises(InvalidOptionError, match="rectum and sigmoid take"):
        gas_of(colon, water=1e-3)
    with pytest.raises(UnsupportedSceneError, match="water"):
        robot = load_device("tracked")
        build_device_scene(robot, replace(device_options(robot), wall_law="table", gas=3000.0, water=1e-4))


def test_water_changes_what_a_scope_meets(colon: Colon):
    wet, dry = (pushed(batch_of(colon, 1, water=water)) for water in (2e-4, 0.0))
    assert np.abs(wet - dry).max() > 1e-3
    assert OPTIONS.water == 0.0


def test_worlds_whose_colons_hang_otherwise_bear_water_that_way(colon: Colon):
    """The second of two worlds is turned onto the left side: it sinks as one that lay so from the beginning."""
    scene = scene_of(colon, **MOVING)
    about = {"device_radius": scene.cable.radius, "with_mesentery": True}
    back, left = (
        lumen_table(colon, **about, abdomen=Abdomen(posture)).seen_from(*entry_of(colon))
        for posture in ("supine", "left")
    )
    assert back.mesentery is not None and left.mesentery is not None
    both = stack([back])._replace(mesentery=mesentery.stack([back.mesentery, left.mesentery]))
    turned, alone = (
        LinearBackend(scene, tables, worlds=count, real=np.float64) for tables, count in ((both, 2), (stack([left]), 1))
    )
    turned.hang(np.array([0, 1]))
    pushed(turned, 1.0)
    pushed(alone, 1.0)
    places, lying = turned.displacement, alone.displacement
    assert places is not None and lying is not None
    np.testing.assert_allclose(places[1], lying[0], atol=1e-9)
    assert np.abs(places[0] - places[1]).max() > 1e-4
