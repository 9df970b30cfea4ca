import numpy as np
import pytest

from haustra.envs.runs.insertion import run_insertion
from haustra.envs.runs.measure.scores import score
from haustra.envs.runs.outcome import Outcome
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import build_scene
from haustra.provenance import Provenance
from tests.tube_colon import straight_tube, wedge_wall


@pytest.fixture(scope="module")
def straight():
    return build_scene(straight_tube(), wedge_wall(), named_design("adult"))


def test_the_follower_reaches_the_end_of_a_straight_tube(straight):
    run = run_insertion(straight, seconds=30)
    assert run.outcome is Outcome.COMPLETED
    assert run.trajectory.tip_arc[-1] > 0.56
    # Nothing stands in the way: hardly any force is needed.
    assert run.trajectory.push_force.max() < 2.0


def test_a_run_is_the_same_to_the_bit_when_repeated(straight):
    first, second = (run_insertion(straight, seconds=3) for _ in range(2))
    np.testing.assert_array_equal(first.trajectory.qpos, second.trajectory.qpos)


def test_a_wall_across_the_lumen_stops_the_scope():
    wall = wedge_wall()
    plug = wall.pieces[0].vertices * [0, 0, 0] + np.array(
        [[x, y, z] for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (0.15, 0.18)]
    )
    pieces = (*wall.pieces, type(wall.pieces[0])(vertices=plug, start=0.15, end=0.18))
    blocked = build_scene(
        straight_tube(), type(wall)("prism", pieces, wall.error, wall.provenance, {}), named_design("adult")
    )
    run = run_insertion(blocked, seconds=30)
    assert run.outcome is Outcome.STUCK
    assert run.trajectory.tip_arc.max() < 0.17


def test_divergence_ends_the_run_and_leaves_no_unsound_record():
    scene = build_scene(straight_tube(), wedge_wall(), named_design("adult"))
    spring = scene.spec.joint("scope/bend_x_005")  # far too stiff for an explicit step, and under tension
    spring.stiffness, spring.damping, spring.armature, spring.springref = [1e7, 0, 0], [0, 0, 0], 0.0, 1.0
    run = run_insertion(scene, seconds=5)
    assert run.outcome is Outcome.DIVERGED
    assert np.isfinite(run.trajectory.qpos).all()
    assert np.isfinite(run.shape).all()
    assert score(scene, run, Provenance(inputs={}, configuration={}))["outcome"] == "diverged"


def test_scores_name_where_the_tip_is(straight):
    run = run_insertion(straight, seconds=4)
    scores = score(straight, run, Provenance(inputs={}, configuration={}))
    assert scores["outcome"] == "time_up"
    assert scores["tip_segment"] == "rectum"
    assert scores["tip_arc_m"] == pytest.approx(scores["insertion_m"], abs=0.01)
    assert float(str(scores["outside_max_mm"])) < 1.0
