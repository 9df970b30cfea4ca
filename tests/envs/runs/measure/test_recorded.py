"""Scope and colon at the records of a run, against what the run itself said of its end."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.linear_insertion import run_linear_insertion
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.envs.runs.measure.surface import left_behind
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.tube_colon import straight_tube


@pytest.fixture(scope="module")
def driven():
    scene = build_scene(
        straight_tube(), None, named_design("adult"), SceneOptions(wall_law="table", mesentery=True), show_lumen=False
    )
    return scene, run_linear_insertion(scene, seconds=2.0, settings=FollowerSettings())


def test_the_last_record_is_where_the_run_ended(driven) -> None:
    scene, run = driven
    recorded = RecordedRun(scene, run.trajectory)
    path, last = recorded.path(-1), len(run.trajectory.time) - 1
    assert path == pytest.approx(run.shape[-len(path) :], abs=1e-6)
    saved = left_behind(scene, run).colon
    assert recorded.colon(last).lumen.vertices == pytest.approx(saved.lumen.vertices, abs=1e-6)


def test_the_worst_of_several_instants_is_told(driven, monkeypatch) -> None:
    """A wall turned inside out at one instant in the middle is not missed by a sound end."""
    from haustra.envs.runs.measure import surface

    scene, run = driven
    assert left_behind(scene, run, records=5).figures == surface.SurfaceFigures(0.0, 0.0, 5, len(run.trajectory.time))
    colon = RecordedRun.colon

    def torn(self: RecordedRun, record: int):
        found = colon(self, record)
        if record == (len(run.trajectory.time) - 1) // 2:
            found.lumen.vertices[np.arange(0, len(found.lumen.vertices), 7)] += 0.2
        return found

    monkeypatch.setattr(RecordedRun, "colon", torn)
    assert left_behind(scene, run, records=5).figures.turned_over > 0.01


def test_a_scope_that_is_outside_between_the_surfaces_that_are_judged_is_found(driven) -> None:
    """At one record it is bent out through the wall, far from those whose triangles are looked at."""
    scene, run = driven
    bent, model = run.trajectory.qpos.copy(), RecordedRun(scene, run.trajectory).model
    record = len(bent) // 2 + 6
    for joint in range(model.njnt)[-8::2]:
        bent[record, model.jnt_qposadr[joint]] = 0.8
    out = replace(run, trajectory=replace(run.trajectory, qpos=bent))
    assert record not in np.linspace(0, len(bent) - 1, 7).astype(int)
    found = left_behind(scene, out).figures
    assert found.outside > 0.01 and found.turned_over == 0 and (found.records, found.looked) == (7, len(bent))
    assert left_behind(scene, run).figures.outside == 0
