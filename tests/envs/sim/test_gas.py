"""Gas in a run: it moves the wall that scopes meet, alike on both backends, and is refused by name elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.runs.insertion import Insertion, run_insertion
from haustra.envs.runs.measure.scores import score
from haustra.envs.sim.capabilities import require_supported
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.gas import ANAL_CANAL, RunGas, run_gas
from haustra.envs.sim.growing import growing
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.accuracy import NOT_MEASURED
from haustra.models.anatomy.colon import Colon, ColonSegment
from haustra.models.anatomy.repair import signed_volume
from haustra.models.devices.scope.library import named_design
from haustra.models.gas.law import MMHG
from haustra.models.gas.numbers import gas_numbers
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.lumen_table import (
    Tables,
    axis_at,
    distended_radius,
    lumen_table,
    put_distended,
    query,
    stack,
)
from haustra.models.wall.table_wall import TableWalls
from haustra.provenance import Provenance
from haustra.scripts.run import Run
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

FULL = gas_numbers()["full_pressure"]
OPTIONS = SceneOptions(
    wall_law="table",
    softening=False,
    insertion_limit=0.35,
    shaft_cell=0.0625,
    bending_cell=0.034,
    twist_hinges=2,
    gas=12 * MMHG,
    gas_start=12 * MMHG,
)
DESIGN = named_design("adult")


@pytest.fixture(scope="module")
def colon() -> Colon:
    found = swept_colon(winding([(0.1, 0.0), (0.1, 1.2), (0.2, 0.0)]), name="bent tube")
    parts = ("rectum", 0.0, 0.1), ("sigmoid", 0.1, 0.3), ("descending", 0.3, found.centreline.length)
    return replace(found, segments=tuple(ColonSegment(*part) for part in parts))


def test_a_wider_lumen_does_no_work_on_the_axis(colon: Colon) -> None:
    """A colon on its side creeps to the same bit whatever width gas holds it at."""
    own = {"device_radius": 0.006, "with_mesentery": True, "abdomen": Abdomen("left")}
    tables, found = stack([lumen_table(colon, **own).tables]), []
    nothing = np.zeros((1, 0)), np.zeros((1, 0, 3)), np.zeros((1, 0, 3)), np.zeros((1, 0, 2))
    for width in (1.0, 1.3):
        walls = TableWalls(tables._replace(wall=tables.wall.copy()), 1, 1, radius=0.006)
        assert walls.displacement is not None
        put_distended(walls.table, tables.wall, np.full(len(tables.wall), width), device_radius=0.006)
        for _ in range(20):
            walls.move(np.zeros(1, int), nothing, 0.005)
        found.append(walls.displacement.pose.copy())
    assert np.abs(found[0][..., :3]).max() > 1e-5
    np.testing.assert_array_equal(*found)


def test_gas_works_on_what_presses_by_force_times_way(colon: Colon) -> None:
    """The energy of a contact changes with the width as the force on it times the way of the wall, to 1e-8."""
    tables = stack([lumen_table(colon, device_radius=0.006).tables])
    radius, stiffness, width, step = tables.wall[40:60, :, 0], 1500.0, 0.9, 1e-4
    place = (radius + 0.006) * width  # 6 mm in the wall

    def depth(width: float) -> np.ndarray:
        return place - distended_radius(np, radius, width, 0.006)

    stored = [0.5 * stiffness * (depth(width + side * step) ** 2).sum() for side in (-1, 1)]
    work = -(stiffness * depth(width) * (radius + 0.006)).sum()
    assert (stored[1] - stored[0]) / (2 * step) == pytest.approx(work, rel=1e-8)


def scene_of(colon: Colon, **changed) -> Scene:
    return build_scene(colon, None, DESIGN, replace(OPTIONS, **changed), show_lumen=False)


def gas_of(colon: Colon, **changed) -> tuple[RunGas, np.ndarray]:
    scene = scene_of(colon, **changed)
    wall = lumen_table(colon, device_radius=scene.cable.radius).tables.wall
    return run_gas(scene.colon, scene.options, stations=len(wall), device_radius=scene.cable.radius), wall


def test_a_wider_lumens_wall_is_further_out_by_that_share(colon: Colon):
    table, device = lumen_table(colon, device_radius=0.005), 0.005
    rest, arcs = table.tables.wall, np.linspace(0.05, 0.3, 9)
    place = axis_at(np, table.tables, arcs)
    wide = rest.copy()
    put_distended(wide, rest, np.full(len(rest), 1.2), device_radius=device)
    open_wall = slice(0, -1)  # at the closed end no device fits
    np.testing.assert_allclose(wide[open_wall, :, 0] + device, 1.2 * (rest[open_wall, :, 0] + device), rtol=1e-12)
    room = [-query(np, table.tables._replace(wall=wall), place, arcs).depth for wall in (rest, wide)]
    assert (room[1] > 1.1 * room[0]).all()
    put_distended(wide, rest, np.ones(len(rest)), device_radius=device)
    np.testing.assert_allclose(wide, rest, atol=1e-15)
    put_distended(wide, rest, np.zeros(len(rest)), device_radius=device)
    assert 0 < wide[..., 0].max() < 1e-3  # a device opens what is collapsed


def test_at_the_set_point_of_ct_colonography_the_lumen_is_as_given(colon: Colon):
    gas, wall = gas_of(colon, gas=FULL, gas_start=FULL)
    np.testing.assert_allclose(gas.widths, 1.0, atol=1e-9)
    less, _ = gas_of(colon)
    inside = np.linspace(0, colon.centreline.length, len(wall)) > ANAL_CANAL + 0.03
    assert (less.widths[inside] < 0.8).all() and less.widths[0] == pytest.approx(1.0, abs=1e-3)
    assert less.stiffness < gas.stiffness < OPTIONS.wall_stiffness + 1000
    narrow = less.colon(colon).lumen
    assert signed_volume(narrow.vertices, narrow.faces) < 0.75 * signed_volume(colon.lumen.vertices, colon.lumen.faces)


def test_a_colon_that_was_grown_at_a_pressure_is_as_given_at_that_pressure(colon: Colon):
    grown = replace(colon, provenance=Provenance(inputs={}, configuration={"pressure": 15 * MMHG}))
    gas, _ = gas_of(grown, gas=15 * MMHG, gas_start=15 * MMHG)
    np.testing.assert_allclose(gas.widths, 1.0, atol=1e-9)
    assert gas_of(grown, gas_start=FULL)[0].widths[60] > 1.1


def test_flow_fills_up_to_the_set_point_and_no_further(colon: Colon):
    gas, _ = gas_of(colon, gas=20 * MMHG, gas_flow=2e-5)
    for _ in range(3000):
        gas.advance(0.2, 0.02)
    seen = gas.record(3000)
    assert seen.volume[-1] > 1.5 * seen.volume[0]
    assert 19 * MMHG < seen.pressure[-1, 1] < 21 * MMHG
    assert (np.diff(seen.given) >= 0).all()


def test_a_hand_that_sucks_narrows_the_lumen_at_the_tip(colon: Colon):
    gas, _ = gas_of(colon, gas=20 * MMHG, gas_start=20 * MMHG)
    before = gas.widths
    gas.ask(-2e-5)
    for _ in range(1000):
        gas.advance(0.2, 0.02)
    assert gas.widths[60] < 0.8 * before[60]
    assert gas.record(1000).given[-1] < -5e-5


def driven(colon: Colon, backend, **changed) -> Insertion:
    return run_insertion(scene_of(colon, **changed), seconds=5.0, backend=backend)


def test_both_backends_meet_the_wall_that_gas_holds(colon: Colon):
    """Alike as without gas; and in a narrower lumen the wall presses more than in the one that was given."""
    linear, native = driven(colon, LinearSingle), driven(colon, NativeEngine)
    usual = driven(colon, LinearSingle, gas=None)
    assert linear.gas is not None and native.gas is not None and usual.gas is None
    np.testing.assert_allclose(linear.gas.volume, native.gas.volume, rtol=1e-3)
    mean = [run.trajectory.wall_force_sum.mean() for run in (linear, native, usual)]
    assert mean[0] == pytest.approx(mean[1], rel=0.15)
    assert mean[0] > 1.1 * mean[2]
    assert abs(linear.trajectory.tip_arc[-1] - native.trajectory.tip_arc[-1]) < 0.01


def test_a_colon_that_was_imaged_with_more_gas_draws_together_alike_on_both_backends(colon: Colon):
    """By centimetres; at the pressure of the image it lies as without gas, but for what the scope does."""

    def moved(backend, pressure: float | None) -> np.ndarray:
        engine = backend(scene_of(colon, mesentery=True, gas=pressure, gas_start=pressure or FULL, gas_flow=6.7e-5))
        for _ in range(100):
            assert engine.step(Controls(0.0, 0.0), 4)
        return engine.read().displacement[:, :3]

    linear, native = moved(LinearSingle, 8 * MMHG), moved(NativeEngine, 8 * MMHG)
    assert np.linalg.norm(linear, axis=1).max() > 0.01
    assert np.abs(native - linear).max() < 0.02 * np.abs(linear).max()
    assert np.abs(moved(LinearSingle, FULL) - moved(LinearSingle, None)).max() < 0.02 * np.abs(linear).max()


def test_shaft_that_is_added_meets_the_same_gas(colon: Colon):
    whole, parts = driven(colon, NativeEngine), driven(colon, growing(None, deepest=1.0))
    assert whole.gas is not None and parts.gas is not None
    np.testing.assert_allclose(parts.gas.volume, whole.gas.volume, rtol=1e-6)
    assert parts.trajectory.wall_force_sum.mean() == pytest.approx(whole.trajectory.wall_force_sum.mean(), rel=0.02)


def test_scores_say_pressure_and_volume_and_null_without_gas(colon: Colon):
    kinds = {"provenance": Provenance(inputs={}, configuration={}), "error": NOT_MEASURED}
    found, usual = (
        score(scene_of(colon, **changed), driven(colon, LinearSingle, **changed), **kinds)
        for changed in ({}, {"gas": None})
    )
    assert found["gas_pressure_peak_mmHg"] == pytest.approx(12, abs=0.3)
    assert 50 < float(str(found["gas_volume_mL"])) < 400
    assert float(str(found["pain_peak"])) > float(str(usual["pain_peak"])) > 0
    assert usual["gas_pressure_peak_mmHg"] is usual["gas_volume_mL"] is None


def test_options_of_a_run_ask_for_gas(tmp_path):
    run = Run(colon=tmp_path, output=tmp_path, insufflate="25mmHg", gas_flow=1e-5)
    assert run._options() | {"gas": pytest.approx(FULL, rel=1e-3), "gas_flow": 1e-5} == run._options()
    with pytest.raises(InvalidOptionError, match="--insufflate"):
        Run(colon=tmp_path, output=tmp_path, gas_flow=1e-5)._options()
    with pytest.raises(InvalidOptionError, match="no pressure"):
        Run(colon=tmp_path, output=tmp_path, insufflate="14mm")._options()


@pytest.mark.parametrize("backend", ["native-batch", "warp"])
def test_other_backends_refuse_it_by_name(colon: Colon, backend: str):
    with pytest.raises(UnsupportedSceneError, match=r"scene\.gas"):
        require_supported(scene_of(colon), backend)


def tables_of(colon: Colon, scene: Scene) -> Tables:
    return stack([lumen_table(colon, device_radius=scene.cable.radius).seen_from(*entry_of(colon))])


def batch_of(colon: Colon, worlds: int, **changed) -> LinearBackend:
    scene = scene_of(colon, **changed)
    return LinearBackend(scene, tables_of(colon, scene), worlds=worlds, real=np.float64)


def pushed(backend: LinearBackend, seconds: float = 4.0) -> np.ndarray:
    """Joint positions of all worlds after pushing into the bend."""
    rates = np.full(backend.worlds, 0.06), np.full(backend.worlds, 0.3)
    for _ in range(round(seconds / 0.02)):
        backend.step(Controls(*rates, np.zeros((backend.worlds, 4))), 4)
    assert backend.alive.all()
    return backend.positions()


def test_one_world_of_many_is_one_alone(colon: Colon):
    """By the same law: 1e-9 m and rad after 800 steps against the wall, of round-off alone."""
    alone, many = batch_of(colon, 1), batch_of(colon, 3)
    assert alone.gas is not None and many.gas is not None
    np.testing.assert_allclose(pushed(many), np.tile(pushed(alone), (3, 1)), atol=1e-9)
    assert alone.read().wall_force_sum[0] > 1.0
    np.testing.assert_allclose(many.gas.pressure, np.tile(alone.gas.pressure, (3, 1)), rtol=1e-9)
    np.testing.assert_allclose(many.gas.volume, np.tile(alone.gas.volume, 3), rtol=1e-9)


@pytest.mark.parametrize("worlds", [1, 2])
def test_programs_hold_the_wall_where_a_moved_table_has_it(colon: Colon, worlds: int):
    """A backend without gas, whose table `put_distended` moved, does the same to round-off."""
    gas = batch_of(colon, worlds, gas_flow=0.0, gas_start=20 * MMHG)
    assert gas.gas is not None
    place, scene = np.arange(worlds), scene_of(colon, gas=None)
    tables = tables_of(colon, scene)
    widths, stiffness = gas.gas.widths(place), gas.gas.stiffness(place)
    assert (np.abs(widths - 1) > 0.01).any()
    put_distended(tables.wall, tables.wall.copy(), widths[0], device_radius=scene.cable.radius)
    moved = LinearBackend(scene, tables, worlds=worlds, real=np.float64)
    moved.reset(place, 0 * place, Conditions(np.full(worlds, scene.options.friction), stiffness, np.ones(worlds)))
    gas.gas = None  # so that pressures stay
    np.testing.assert_allclose(pushed(gas), pushed(moved), rtol=0, atol=1e-9)
    assert (moved.read().wall_force_sum > 1.0).all()


def test_gas_of_many_worlds_is_kept_and_its_own(colon: Colon):
    """Nothing is lost but 1e-6, and a world's bits do not depend on what its neighbours hold."""
    both = []
    for flow in (2e-5, -2e-5):
        batch = batch_of(colon, 2)
        gas = batch.gas
        assert gas is not None
        gas.asked, begun = np.array([1e-5, flow]), gas.state.held.sum(axis=1)
        seen, state = pushed(batch), gas.state
        parts = state.held.sum(axis=1) + state.leaked + state.absorbed - state.given - begun
        assert np.abs(parts / state.given).max() < 1e-6
        both.append((seen, gas.pressure, gas.volume))
    for one, other in zip(*both, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        assert (one[1] != other[1]).any()


def test_worlds_have_tissue_and_colons_of_their_own(colon: Colon):
    """A softer tissue stays softer under gas, and each colon's gas is by its own segments."""
    scene, short = scene_of(colon), replace(colon, segments=(ColonSegment("caecum", 0.0, colon.centreline.length),))
    table = lumen_table(colon, device_radius=scene.cable.radius).seen_from(*entry_of(colon))
    batch = LinearBackend(scene, stack([table, table]), worlds=2, colons=[colon, short])
    assert batch.gas is not None
    one = np.ones(2)
    batch.reset(np.arange(2), np.array([0, 1]), Conditions(0.05 * one, np.array([900.0, 1900.0]), one))
    stiffness = batch.gas.stiffness(np.arange(2))
    assert (stiffness > [900.0, 1900.0]).all() and stiffness[1] - stiffness[0] == pytest.approx(1000.0, abs=200.0)
    widths = batch.gas.widths(np.arange(2))
    assert (np.abs(widths[0, 30:] - widths[1, 30:]) > 0.01).all()
    with pytest.raises(InvalidOptionError, match="segments"):
        LinearBackend(scene, stack([table, table]), worlds=2, colons=[colon])


def test_gas_is_kept_and_put_back(colon: Colon):
    batch = batch_of(colon, 2)
    pushed(batch, 0.2)
    kept = batch.keep()
    then = pushed(batch, 0.4)
    batch.put_back(kept)
    np.testing.assert_array_equal(pushed(batch, 0.4), then)


def test_gpus_derivatives_other_walls_and_other_segments_refuse_it(colon: Colon):
    scene = scene_of(colon)
    tables = tables_of(colon, scene)
    with pytest.raises(UnsupportedSceneError, match=r"scene\.gas"):
        LinearBackend(scene, tables, worlds=2, device="cuda")
    with pytest.raises(UnsupportedSceneError, match=r"scene\.gas"):
        LinearBackend(scene, tables, worlds=2, directions=1)
    with pytest.raises(InvalidOptionError, match="table"):
        SceneOptions(gas=FULL, wall_law="pieces")
    strange = replace(colon, segments=(ColonSegment("gut", 0.0, colon.centreline.length),))
    with pytest.raises(InvalidOptionError, match="gut"):
        gas_of(strange)
