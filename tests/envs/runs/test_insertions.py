"""Many insertions at once: ends, scores and independence of worlds."""

from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

from haustra.envs.control.endoscopist import EndoscopistSettings
from haustra.envs.control.follower import FollowerSettings
from haustra.envs.control.follower_worlds import WorldsFollower
from haustra.envs.runs.insertion import run_insertion
from haustra.envs.runs.insertions import run_insertions
from haustra.envs.runs.linear_insertion import run_linear_insertion
from haustra.envs.runs.linear_insertions import LinearInsertions
from haustra.envs.runs.outcome import Outcome
from haustra.envs.runs.tally import Insertions
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.scope_colon_set import ScopeColonSet, build_bank
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.tube_colon import straight_tube


@pytest.fixture(scope="module")
def bank() -> ScopeColonSet:
    bent = swept_colon(winding([(0.1, 0.0), (0.12, 1.2), (0.1, 0.0)]), name="bend")
    options = SceneOptions(shaft_cell=0.0625, bending_cell=0.034, sample_spacing=0.03)
    return build_bank([straight_tube(0.3), bent], named_design("paediatric"), options)


NEEDS_WARP = pytest.mark.skipif(find_spec("warp") is None, reason="the extra warp is not installed")
COLON = np.array([0, 1, 1, 1])
PUSH_LIMIT = np.array([43.0, 43.0, 0.05, 43.0])
STIFFNESS = np.array([1500.0, 1500.0, 1500.0, 5.0])
"""The straight tube, the bend, the bend with a hand that hardly pushes, and with a wall that hardly holds."""


@pytest.fixture(scope="module")
def both(bank: ScopeColonSet) -> dict[str, Insertions]:
    """Run four worlds in linear time and, where it is installed, by MuJoCo Warp."""
    linear = LinearInsertions(bank.scene, bank.tables, bank.colons, worlds=4, settings=FollowerSettings())
    one = np.ones(4)
    linear.begin(COLON, Conditions(bank.scene.options.friction * one, STIFFNESS, one), {"push_limit": PUSH_LIMIT})
    found = {"linear": linear.run(seconds=14)}
    if find_spec("warp"):
        own: Any = {"colon": COLON, "push_limit": PUSH_LIMIT, "stiffness": STIFFNESS}
        found["warp"] = run_insertions(bank, worlds=4, seconds=14, **own)
    return found


@pytest.fixture(params=["linear", pytest.param("warp", marks=NEEDS_WARP)])
def runs(both: dict[str, Insertions], request: pytest.FixtureRequest) -> Insertions:
    """Those of one backend."""
    return both[request.param]


@NEEDS_WARP
def test_mujoco_warp_goes_the_same_way(both: dict[str, Insertions]) -> None:
    """Follower, endings and scores are shared; outside, where nothing holds the scope, ways part.

    The peak of a push is one instant of slip in the bend, where MuJoCo's friction is stiffer: within a fifth.
    """
    linear, warp = both["linear"], both["warp"]
    assert linear.outcome == warp.outcome
    for name, share in (("tip_arc_max", 0.01), ("insertion", 0.01), ("push_force_peak", 0.2), ("wall_force_mean", 0.1)):
        ours, theirs = (getattr(runs, name)[:3] for runs in (linear, warp))
        np.testing.assert_allclose(ours, theirs, rtol=share, atol=1e-3, err_msg=name)


def test_one_scope_leaves_the_rows_of_the_run_that_many_make(bank: ScopeColonSet) -> None:
    """In double precision, alone: what is recorded at each decision adds up to the scores of the batch."""
    colon = bank.colons[1]
    options = replace(bank.scene.options, insertion_limit=0.4)
    scene = build_scene(colon, None, bank.scene.design, options)
    run = run_linear_insertion(scene, seconds=6.0)
    tables = build_bank([colon], bank.scene.design, options).tables
    many = LinearInsertions(scene, tables, [colon], worlds=1, settings=FollowerSettings(), real=np.float64)
    one = np.ones(1)
    many.begin(np.zeros(1, int), Conditions(options.friction * one, options.wall_stiffness * one, one))
    scores, seen = many.run(seconds=6.0), run.trajectory
    assert len(seen.time) == 300 and run.outcome is scores.outcome[0]
    assert seen.tip_arc.max() == pytest.approx(scores.tip_arc_max[0], rel=1e-9)
    assert np.abs(seen.push_force).max() == pytest.approx(scores.push_force_peak[0], rel=1e-9)
    assert seen.wall_force.mean() == pytest.approx(scores.wall_force_mean[0], rel=1e-9)
    assert seen.outside.max() < 0.03 and seen.contacts.max() > 0
    assert seen.load.max() == pytest.approx(scores.load_peak[0], rel=1e-9)
    assert seen.load_arc[seen.load.argmax()] == pytest.approx(scores.load_arc[0], rel=1e-9)
    np.testing.assert_allclose(run.shape[-1], seen.tip[-1], atol=1e-9)


def test_gas_of_a_batch_is_that_of_one_run(bank: ScopeColonSet) -> None:
    """Pressures, volumes, loads and pain of a run whose rows are measured afterwards.

    A program hears of pressures one decision later, so that what is said of loads leaves out their last rise.
    """
    given = bank.colons[1]
    colon = replace(given, segments=(ColonSegment("sigmoid", 0.0, given.centreline.length),))
    options = replace(bank.scene.options, insertion_limit=0.4, gas=4000.0, gas_flow=2e-5, gas_start=2500.0)
    scene = build_scene(colon, None, bank.scene.design, options)
    run, tables = run_linear_insertion(scene, seconds=6.0), build_bank([colon], bank.scene.design, options).tables
    many = LinearInsertions(scene, tables, [colon], worlds=2, settings=FollowerSettings(), real=np.float64)
    one = np.ones(2)
    many.begin(np.zeros(2, int), Conditions(options.friction * one, options.wall_stiffness * one, one))
    scores, seen = many.run(seconds=6.0), run.trajectory
    assert run.gas is not None and scores.gas_pressure_peak is not None and scores.gas_volume is not None
    np.testing.assert_allclose(scores.gas_pressure_peak, run.gas.pressure.max(), rtol=1e-6)
    np.testing.assert_allclose(scores.gas_volume, run.gas.volume[-1], rtol=1e-6)
    np.testing.assert_allclose(scores.tip_arc_max, seen.tip_arc.max(), rtol=1e-6)
    np.testing.assert_allclose(scores.push_force_peak, np.abs(seen.push_force).max(), rtol=1e-4)
    np.testing.assert_allclose(scores.load_peak, seen.load.max(), rtol=5e-3)
    np.testing.assert_allclose(scores.pain_peak, seen.pain.max(), rtol=0.02)


def test_followers_of_a_batch_have_settings_of_their_own(bank: ScopeColonSet) -> None:
    settings = [FollowerSettings(), FollowerSettings(advance_rate=0.02)]
    many = LinearInsertions(bank.scene, bank.tables, bank.colons, worlds=2, settings=settings)
    one = np.ones(2)
    many.begin(np.zeros(2, int), Conditions(0.1 * one, 1500.0 * one, one))
    fast, slow = many.run(seconds=2.0).insertion - bank.scene.options.start_depth
    assert slow == pytest.approx(fast / 2, rel=0.05)
    with pytest.raises(InvalidOptionError, match="all straighten"):
        LinearInsertions(
            bank.scene,
            bank.tables,
            bank.colons,
            worlds=2,
            settings=[FollowerSettings(), FollowerSettings(straighten=True)],
        )


def test_short_tubes_are_passed_and_a_hand_without_force_is_not(runs: Insertions) -> None:
    assert runs.outcome[:2] == (Outcome.COMPLETED, Outcome.COMPLETED)
    assert runs.outcome[2] in (Outcome.TIME_UP, Outcome.STUCK)
    assert runs.tip_arc_max[0] == pytest.approx(0.27, abs=0.005)
    assert runs.tip_arc_max[2] < 0.25


def test_a_scope_that_leaves_through_the_wall_has_escaped(runs: Insertions) -> None:
    """As a single run ends: three centimetres outside, with the wall that deep."""
    assert runs.outcome[3] is Outcome.ESCAPED
    assert runs.simulated[3] < 13
    assert runs.p_perforation[3] == 1.0


def test_who_perforates_follows_from_the_largest_load(runs: Insertions) -> None:
    """A hand that hardly pushes tears nobody; loads are where the scope was, and below what the shaft alone bears."""
    assert 0 < runs.load_peak[2] < runs.load_peak[1] < 1
    assert (np.diff(runs.p_perforation[[2, 1, 3]]) >= 0).all() and runs.p_perforation[2] < 1e-9
    assert 0 < runs.pain_peak[2] < runs.pain_peak[1]
    assert (runs.load_arc >= 0).all() and (runs.load_arc <= runs.tip_arc_max + 0.01).all()
    assert runs.load_peak[1] <= runs.wall_force_peak[1] / (1.5 * 14.1 * 0.9)


def test_scores_are_those_of_the_run_up_to_its_end(runs: Insertions) -> None:
    assert runs.simulated[0] < 13
    assert runs.simulated[2] == pytest.approx(14, abs=0.03)
    assert runs.push_force_peak[2] <= 0.05 + 1e-6
    assert runs.wall_force_peak[1] > runs.wall_force_mean[1] > 0
    assert runs.insertion[0] == pytest.approx(0.27, abs=0.01)


def test_wheels_steer_many_worlds_in_linear_time_only(bank: ScopeColonSet) -> None:
    wheels = FollowerSettings(steer="wheels")
    with pytest.raises(InvalidOptionError, match="wheels"):
        WorldsFollower(wheels, bank.tip_links)
    with pytest.raises(InvalidOptionError, match="steer alike"):
        LinearInsertions(bank.scene, bank.tables, bank.colons, worlds=2, settings=[wheels, FollowerSettings()])
    many = LinearInsertions(bank.scene, bank.tables, bank.colons, worlds=2, settings=wheels)
    one, options = np.ones(2), bank.scene.options
    many.begin(np.zeros(2, int), Conditions(options.friction * one, options.wall_stiffness * one, one))
    found = many.run(seconds=2.0)
    assert found.insertion[0] > options.start_depth + 0.02
    np.testing.assert_array_equal(found.insertion[0], found.insertion[1])


@NEEDS_WARP
def test_unknown_parameters_are_refused(bank: ScopeColonSet) -> None:
    with pytest.raises(InvalidOptionError, match="stifness"):
        run_insertions(bank, worlds=1, seconds=1.0, stifness=1.0)


def test_an_endoscopist_who_gives_up_ends_the_insertion(bank: ScopeColonSet) -> None:
    """On every backend, and after the same attempts: the hand hardly pushes, so that no lumen passes."""
    weak = replace(bank.scene.options, push_limit=0.05)
    tube = build_bank([bank.colons[1]], named_design("paediatric"), weak)
    settings = EndoscopistSettings(patience=2.0, most_attempts=2.0, rest=3.0)
    single = [run_insertion(tube.scene, seconds=60, settings=settings)]
    single.append(run_linear_insertion(tube.scene, seconds=60, settings=settings))
    assert [each.outcome for each in single] == [Outcome.STUCK] * 2
    assert [each.attempts for each in single] == [2, 2]
    ends = [float(each.trajectory.time[-1]) for each in single]
    many = LinearInsertions(tube.scene, tube.tables, tube.colons, worlds=2, settings=settings)
    one = np.ones(2)
    many.begin(np.zeros(2, int), Conditions(weak.friction * one, weak.wall_stiffness * one, one))
    runs = [many.run(seconds=60)]
    if find_spec("warp"):
        runs.append(run_insertions(tube, worlds=2, seconds=60, settings=settings))
    assert {each.outcome for each in runs} == {(Outcome.STUCK, Outcome.STUCK)}
    ends += [float(end) for each in runs for end in each.simulated]
    assert max(ends) < 30 and np.ptp(ends) < 2.0
