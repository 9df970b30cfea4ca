"""Records that are looked at closely: all at which the scope is outside the saved surface, and few others."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.linear_insertion import run_linear_insertion
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.envs.runs.measure.screen import WallScreen
from haustra.envs.runs.measure.surface import left_behind, outside_at_records, surface_figures
from haustra.models.anatomy.colon import ColonSegment
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

_BENT = [(0.06, 0.0), (0.05, np.pi / 2), (0.2, 0.0)]


_GAS = {"gas": 4000.0, "gas_flow": 5e-5, "gas_start": 1000.0}


@pytest.fixture(
    scope="module",
    params=[{"mesentery": True}, {"mesentery": False}, {"mesentery": True, **_GAS}],
    ids=["moving", "fixed", "gas"],
)
def driven(request):
    colon = swept_colon(winding(_BENT), name="bent")
    colon = replace(colon, segments=(ColonSegment("sigmoid", 0.0, colon.centreline.length),))
    options = SceneOptions(wall_law="table", **request.param)
    scene = build_scene(colon, None, named_design("adult"), options, show_lumen=False)
    return scene, run_linear_insertion(scene, seconds=5.0, settings=FollowerSettings())


def test_a_scope_that_leans_on_bends_is_seen_to_be_inside_without_laying_the_surface(driven, monkeypatch) -> None:
    scene, run = driven
    before = RecordedRun(scene, run.trajectory, run.gas)
    last = before.colon(len(run.trajectory.time) - 1).lumen.vertices
    within = 1e-6 if run.gas is None else 1e-4  # gas may move once more after the last decision
    assert last == pytest.approx(left_behind(scene, run).colon.lumen.vertices, abs=within)
    monkeypatch.setattr(before, "colon", None)
    found = outside_at_records(run, before)
    assert found.shape == run.trajectory.time.shape and found.max() == 0
    assert run.trajectory.wall_force.max() > 1


def test_no_record_is_missed_at_which_the_scope_is_outside(driven) -> None:
    """Bent at random at a third of the records, so that it stands in the wall, or out through it, or folds back."""
    scene, run = driven
    random, before = np.random.default_rng(0), RecordedRun(scene, run.trajectory, run.gas)
    bent, model = run.trajectory.qpos.copy(), before.model
    kicked = np.arange(60, len(bent), 7)
    for record in kicked:
        joints = np.arange(model.njnt - 16, model.njnt)
        bent[record, model.jnt_qposadr[joints]] += random.uniform(0, 1) * random.uniform(-1.2, 1.2, len(joints))
    out = RecordedRun(scene, replace(run.trajectory, qpos=bent), run.gas)
    screen, outside, doubtful = WallScreen(out), [], []
    for record in range(kicked[-1] + 1):
        look = screen.doubtful(record)
        if record in kicked:
            figures = surface_figures(scene.colon, out.colon(record), out.arcs, out.path(record))
            outside.append(figures.outside > 0)
            doubtful.append(look)
    assert all(np.array(doubtful)[outside]) and 3 < np.sum(outside) < len(kicked)
