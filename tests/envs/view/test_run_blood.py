"""Pictures of a run show blood where the run's wall bled, and since then."""

import numpy as np
import pytest

from haustra.envs.console.motion import run_surroundings
from haustra.envs.console.painter import Camera, Eye, Glance
from haustra.envs.runs.measure.injury import stations_of
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.envs.view.run_blood import REACH, run_blood
from haustra.models.injury import bleeding


@pytest.fixture
def bled(source, monkeypatch):
    """The run with the threshold at half of what the wall bore, and with it out of reach."""
    run = RecordedRun(source.scene, source.moments.trajectory)
    peak = float(run.trajectory.shear.max())
    found = []
    for threshold in (0.5 * peak, 1.01 * peak):
        monkeypatch.setattr(bleeding, "injury_number", lambda name, number=threshold: number)
        found.append(run_blood(run))
    return run, peak, *found


def test_blood_lies_where_and_since_the_wall_was_sheared_too_much(bled):
    run, peak, places, nothing = bled
    assert not len(nothing) and len(places)
    shear, arcs = run.trajectory.shear, stations_of(run.scene.colon)
    bore = shear > 0.5 * peak
    assert len(places) == bore.any(axis=0).sum()
    lumen = run.scene.colon.lumen.vertices
    for place, station in zip(places, np.flatnonzero(bore.any(axis=0)), strict=True):
        vertex = int(np.linalg.norm(lumen - place[:3], axis=1).argmin())
        assert abs(run.arcs[vertex] - arcs[station]) <= REACH
        assert place[4] == run.trajectory.time[bore[:, station].argmax()]


def test_a_picture_of_a_run_that_bleeds_is_redder_there(bled):
    run, _, places, _ = bled
    line = run.scene.colon.centreline
    at = int(np.linalg.norm(line.points - places[0, :3], axis=1).argmin())
    behind = int(np.searchsorted(line.arc, line.arc[at] - 0.03))
    eye = Eye(Camera(run_surroundings(run.scene, run.trajectory), 96))
    view = line.points[behind], line.frames[behind], float(line.arc[behind])
    clean, bloody = (eye.draw(Glance(*view, blood=blood)).astype(float) for blood in (None, places[:, :4]))
    darker = clean[..., 1] - bloody[..., 1] > 25
    assert darker.mean() > 0.01, "no blood is seen"
    was, now = ((one[darker][:, 0] / one[darker][:, 1:].mean(axis=1)).mean() for one in (clean, bloody))
    assert now > 1.3 * was
    assert np.abs(eye.draw(Glance(*view)).astype(float) - clean).max() < 60, "gone back in time, it has not bled"
