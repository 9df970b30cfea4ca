"""Records that are looked at closely: all at which the scope is outside the saved surface, and few others."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.linear_insertion import run_linear_insertion
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.envs.runs.measure.screen import WallScreen
from haustra.envs.runs.measure.surface import outside_at_records, surface_figures
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

_BENT = [(0.06, 0.0), (0.05, np.pi / 2), (0.2, 0.0)]


@pytest.fixture(scope="module", params=[True, False], ids=["moving", "fixed"])
def driven(request):
    colon = swept_colon(winding(_BENT), name="bent")
    options = SceneOptions(wall_law="table", mesentery=request.param)
    scene = build_scene(colon, None, named_design("adult"), options, show_lumen=False)
    return scene, run_linear_insertion(scene, seconds=5.0, settings=FollowerSettings())


def test_a_scope_that_leans_on_bends_is_seen_to_be_inside_without_laying_the_surface(driven, monkeypatch) -> None:
    scene, run = driven
    before = RecordedRun(scene, run.trajectory)
    monkeypatch.setattr(before, "colon", None)
    found = outside_at_records(run, before)
    assert found.shape == run.trajectory.time.shape and found.max() == 0
    assert run.trajectory.wall_force.max() > 1


def test_no_record_is_missed_at_which_the_scope_is_outside(driven) -> None:
    """Bent at random at a third of the records, so that it stands in the wall, or out through it, or folds back."""
    scene, run = driven
    random, before = np.random.default_rng(0), RecordedRun(scene, run.trajectory)
    bent, model = run.trajectory.qpos.copy(), before.model
    kicked = np.arange(60, len(bent), 7)
    for record in kicked:
        joints = np.arange(model.njnt - 16, model.njnt)
        bent[record, model.jnt_qposadr[joints]] += random.uniform(0, 1) * random.uniform(-1.2, 1.2, len(joints))
    out = RecordedRun(scene, replace(run.trajectory, qpos=bent))
    screen, outside, doubtful = WallScreen(out), [], []
    for record in range(kicked[-1] + 1):
        look = screen.doubtful(record)
        if record in kicked:
            figures = surface_figures(scene.colon, out.colon(record), out.arcs, out.path(record))
            outside.append(figures.outside > 0)
            doubtful.append(look)
    assert all(np.array(doubtful)[outside]) and 3 < np.sum(outside) < len(kicked)
