"""Pictures of a run show blood where the run's wall bled, and since then."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from haustra.envs.console.motion import run_surroundings
from haustra.envs.console.painter import Camera, Eye, Glance
from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.insertion import Insertion
from haustra.envs.runs.measure.injury import stations_of
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.envs.runs.outcome import Outcome
from haustra.envs.view import run_folder
from haustra.envs.view.dataset.clip import write_clip
from haustra.envs.view.dataset.moments import Moments
from haustra.envs.view.picture.lens import named_lens
from haustra.envs.view.run_blood import REACH, run_blood
from haustra.envs.view.run_folder import write_run
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
    _assert_bloody(bloody, clean)
    assert np.abs(eye.draw(Glance(*view)).astype(float) - clean).max() < 60, "gone back in time, it has not bled"


def _backwards(source, count):
    """So many records of the run backwards, as on a way out: what bled deep inside comes into view."""
    run = source.moments.trajectory
    return replace(
        run, **{name: (values if name == "time" else values[::-1])[:count] for name, values in vars(run).items()}
    )


def _bled_and_never(run, monkeypatch):
    """Let the run bleed after its first record, then nowhere; 0 and 1."""
    for number, threshold in enumerate((1.01 * float(run.shear[0].max()), 1.01 * float(run.shear.max()))):
        monkeypatch.setattr(bleeding, "injury_number", lambda _, threshold=threshold: threshold)
        yield number


def test_a_data_set_shows_blood_where_and_since_its_run_bled(source, monkeypatch, tmp_path):
    run, pictures = _backwards(source, 201), []
    records = 0, 160, 200
    for number in _bled_and_never(run, monkeypatch):
        folder, moments = tmp_path / str(number), Moments(source.scene, run)
        assert (len(moments.blood) > 0) == (number == 0)
        write_clip(folder, moments, records, named_lens("cf-hq190l").at(96, 77))
        names = [f"{frame:04d}_color.png" for frame in range(len(records))]
        pictures.append([np.asarray(Image.open(folder / name), float) for name in names])
    assert np.array_equal(pictures[0][0], pictures[1][0]), "nothing has bled yet"
    for bloody, clean in zip(pictures[0][1:], pictures[1][1:], strict=True):
        _assert_bloody(bloody, clean)


def test_the_last_picture_of_a_run_that_bleeds_is_redder(source, monkeypatch, tmp_path):
    monkeypatch.setattr(run_folder, "_TIP_SIZE", 96)
    # What else a run's folder holds is none of this (`tests/scripts/test_run.py`).
    for name in ("report_run", "time_figure", "injury_map", "write_motion"):
        monkeypatch.setattr(run_folder, name, lambda *_, **__: None)
    run = _backwards(source, 181)
    seen, pictures = RecordedRun(source.scene, run), []
    shape = seen.shape(180)
    ended = Insertion(Outcome.TIME_UP, run, shape, seen.tip_frame(), 1.0, 0, FollowerSettings(), seen.colon(180))
    for number in _bled_and_never(run, monkeypatch):
        scores = write_run(tmp_path / str(number), scene=source.scene, run=ended)
        assert (scores["bleeding_places"] > 0) == (number == 0)
        pictures.append(np.asarray(Image.open(tmp_path / str(number) / "tip.png"), float))
    _assert_bloody(*pictures)


def _assert_bloody(bloody: np.ndarray, clean: np.ndarray) -> None:
    darker = clean[..., 1] - bloody[..., 1] > 25
    assert darker.mean() > 0.01, "no blood is seen"
    was, now = ((one[darker][:, 0] / one[darker][:, 1:].mean(axis=1)).mean() for one in (clean, bloody))
    assert now > 1.3 * was
