"""Gas in a run: it moves the wall that scopes meet, alike on both backends, and is refused by name elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.runs.insertion import Insertion, run_insertion
from haustra.envs.runs.measure.scores import score
from haustra.envs.sim.capabilities import require_supported
from haustra.envs.sim.gas import ANAL_CANAL, RunGas
from haustra.envs.sim.growing import growing
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.native import NativeEngine
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.accuracy import NOT_MEASURED
from haustra.models.anatomy.colon import Colon, ColonSegment
from haustra.models.anatomy.repair import signed_volume
from haustra.models.devices.scope.library import named_design
from haustra.models.gas.law import MMHG
from haustra.models.gas.numbers import gas_numbers
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall.lumen_table import axis_at, lumen_table, put_distended, query, stack
from haustra.provenance import Provenance
from haustra.scripts.run import Run
from tests.bent_colon import bent_colon

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
    found = bent_colon([(0.1, 0.0), (0.1, 1.2), (0.2, 0.0)])[0]
    parts = ("rectum", 0.0, 0.1), ("sigmoid", 0.1, 0.3), ("descending", 0.3, found.centreline.length)
    return replace(found, segments=tuple(ColonSegment(*part) for part in parts))


def scene_of(colon: Colon, **changed) -> Scene:
    return build_scene(colon, None, DESIGN, replace(OPTIONS, **changed), show_lumen=False)


def gas_of(colon: Colon, **changed) -> tuple[RunGas, np.ndarray]:
    scene = scene_of(colon, **changed)
    wall = lumen_table(colon, device_radius=scene.cable.radius).tables.wall
    return RunGas(scene.colon, scene.options, wall, device_radius=scene.cable.radius), wall


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
    before, gas.asked = gas.widths, -2e-5
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


def test_many_worlds_other_walls_and_other_segments_refuse_it(colon: Colon):
    scene = scene_of(colon)
    tables = stack([lumen_table(colon, device_radius=scene.cable.radius).seen_from(*entry_of(colon))])
    with pytest.raises(UnsupportedSceneError, match=r"scene\.gas"):
        LinearBackend(scene, tables, worlds=2)
    with pytest.raises(InvalidOptionError, match="table"):
        SceneOptions(gas=FULL, wall_law="pieces")
    strange = replace(colon, segments=(ColonSegment("gut", 0.0, colon.centreline.length),))
    with pytest.raises(InvalidOptionError, match="gut"):
        gas_of(strange)
