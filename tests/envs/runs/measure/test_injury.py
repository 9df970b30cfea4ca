"""What a run does to the colon, through public interfaces: native and linear time agree, and an escape is a tear."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.insertion import Insertion, run_insertion
from haustra.envs.runs.linear_insertion import run_linear_insertion
from haustra.envs.runs.linear_insertions import LinearInsertions
from haustra.envs.runs.measure.injury import InjuryMeter, stations_of
from haustra.envs.runs.measure.scores import score
from haustra.envs.runs.outcome import Outcome
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.native import NativeEngine
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.devices.scope.library import named_design
from haustra.models.injury.perforation import SIGMA
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall.lumen_table import lumen_table, stack
from haustra.provenance import Provenance
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

OPTIONS = SceneOptions(wall_law="table", shaft_cell=0.0625, bending_cell=0.034, insertion_limit=0.4)

UNSTEERED = FollowerSettings(steer_limit_deg=1.0)
"""Pushed into a bend that the tip is not turned into, a scope presses on it."""


def _scene(**changed) -> Scene:
    colon = swept_colon(winding([(0.1, 0.0), (0.12, 1.6), (0.15, 0.0)]), name="bend")
    length = colon.centreline.length
    segments = (ColonSegment("rectum", 0.0, 0.1), ColonSegment("sigmoid", 0.1, length))
    design = named_design("paediatric")
    return build_scene(replace(colon, segments=segments), None, design, replace(OPTIONS, **changed), show_lumen=False)


def _scores(scene: Scene, run: Insertion) -> dict:
    return score(scene, run, Provenance(inputs={}, configuration={}))


@pytest.fixture(scope="module", params=[False, True], ids=["fixed", "mesentery"])
def both(request: pytest.FixtureRequest) -> tuple[Scene, Insertion, Insertion]:
    scene = _scene(mesentery=request.param)
    native = run_insertion(scene, seconds=6.0, settings=UNSTEERED)
    return scene, native, run_linear_insertion(scene, seconds=6.0, settings=UNSTEERED)


def test_native_and_linear_time_tell_the_same_injury(both: tuple[Scene, Insertion, Insertion]) -> None:
    """Backends share the laws of injury: differences are those of their steps, largest where links strike.

    The one worst instant of a run is a strike that falls otherwise on another processor; the worst hundredth is not.
    """
    scene, native, linear = both
    ours, theirs = _scores(scene, native), _scores(scene, linear)
    ran, other = native.trajectory, linear.trajectory
    assert ran.load.max() > 0.02
    assert ran.load.mean() == pytest.approx(other.load.mean(), rel=0.1)
    assert ours["perforation_site"] == theirs["perforation_site"] == "sigmoid"
    assert ours["p_perforation"] < 1e-20 and theirs["p_perforation"] < 1e-20
    for share in (90, 99):
        usual, alike = (np.percentile(run.pain.max(axis=1), share) for run in (ran, other))
        assert usual == pytest.approx(alike, rel=0.05)
    np.testing.assert_allclose(ran.pain.mean(axis=0), other.pain.mean(axis=0), atol=0.1 * ran.pain.mean(axis=0).max())


def test_a_batch_keeps_what_the_rows_of_one_run_add_up_to(both: tuple[Scene, Insertion, Insertion]) -> None:
    """In double precision, the same program: largest load and pain, and where they were."""
    scene, _, linear = both
    table = lumen_table(scene.colon, device_radius=scene.cable.radius, with_mesentery=scene.options.mesentery)
    tables = stack([table.seen_from(*entry_of(scene.colon))])
    many = LinearInsertions(scene, tables, [scene.colon], worlds=1, settings=UNSTEERED, real=np.float64)
    one = np.ones(1)
    options = scene.options
    many.begin(np.zeros(1, int), Conditions(options.friction * one, options.wall_stiffness * one, one))
    runs, seen = many.run(seconds=6.0), linear.trajectory
    assert runs.load_peak[0] == pytest.approx(seen.load.max(), rel=1e-6)
    assert runs.load_arc[0] == pytest.approx(seen.load_arc[seen.load.argmax()], rel=1e-6)
    assert runs.pain_peak[0] == pytest.approx(seen.pain.max(), rel=1e-3)
    place = stations_of(scene.colon)[seen.pain.max(axis=0).argmax()]
    assert runs.pain_arc[0] == pytest.approx(place, abs=0.0101)


def test_maps_add_up_to_what_is_recorded_beside_them(both: tuple[Scene, Insertion, Insertion]) -> None:
    scene, native, _ = both
    seen = native.trajectory
    assert seen.pressed.shape == seen.pain.shape == (len(seen.time), len(stations_of(scene.colon)))
    np.testing.assert_allclose(seen.pressed.max(axis=1), seen.wall_force, atol=1e-9)
    where = seen.load.argmax()
    beside = stations_of(scene.colon)[np.argmax(seen.pressed[where])]
    assert beside == pytest.approx(seen.load_arc[where], abs=0.011)
    scores = _scores(scene, native)
    assert scores["pain_peak"] == max(scores["pain_by_site"].values())
    assert scores["bleeding_places"] == sum(scores["bleeding_by_site"].values())


def test_a_mesentery_hurts_beside_the_wall_and_a_fixed_colon_by_its_wall_only(
    both: tuple[Scene, Insertion, Insertion],
) -> None:
    scene, native, _ = both
    seen = native.trajectory
    under = seen.shear > 0
    assert (seen.pain[under] > 0).all()
    assert seen.pain[~under].max() == 0.0 or scene.options.mesentery
    assert (seen.pain[~under].max() > 1e-3) == scene.options.mesentery


def test_a_run_that_ends_as_escaped_has_torn_everybodys_colon() -> None:
    scene = _scene(wall_stiffness=10.0)
    for drive in (run_insertion, run_linear_insertion):
        run = drive(scene, seconds=14.0, settings=UNSTEERED)
        scores = _scores(scene, run)
        assert run.outcome is Outcome.ESCAPED and scores["p_perforation"] == 1.0
        assert scores["perforation_site"] in ("rectum", "sigmoid")


def test_gas_under_pressure_tears_and_hurts_by_itself() -> None:
    """Half of people burst at the pressure of the segment; the wall bears p r (Laplace)."""
    scene = _scene()
    seen = NativeEngine(scene).read()
    none = {name: getattr(seen, name)[None] for name in ("link_forces", "link_arcs", "bend")}
    meter = InjuryMeter(scene)
    pressure = np.zeros((1, len(meter.stations)))
    pressure[0, 8] = 22531.0 * np.exp(SIGMA)
    burden = meter.measure(seen._replace(**none), pressure)
    assert burden.load[0] == pytest.approx(np.exp(SIGMA)) and burden.load_arc[0] == pytest.approx(0.16)
    assert burden.pain[0, 8] == pytest.approx(pressure[0, 8] * 0.02 / 100.0, rel=0.02)
    assert meter.measure(seen._replace(**none)).load[0] == 0.0
