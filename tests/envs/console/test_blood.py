"""Where the wall of a drive has bled: recorded, done again to the bit, taken back, and in its pictures."""

from typing import Any

import numpy as np
import pytest

from haustra.envs.console.film import draw_pictures
from haustra.envs.console.painter import Camera, Eye, Glance
from haustra.envs.console.recording import Recorder, load_recording
from haustra.envs.console.replay import repeat
from haustra.envs.console.session import Session
from haustra.envs.console.source import glance_at, moment
from haustra.envs.console.vehicles import make_vehicle, surroundings
from haustra.envs.tasks.config import TaskConfig
from haustra.models.injury import bleeding


@pytest.fixture(scope="module")
def bled(colon_folder, scope, tmp_path_factory):
    """In and out again; the wall bleeds from a little shear on, and goes back to before it did where it is sheared."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bleeding, "injury_number", lambda name: 20.0)
        folder = tmp_path_factory.mktemp("bled")
        vehicle: Any = make_vehicle(colon_folder, scope)
        session = Session(vehicle, Recorder(folder, vehicle, driver="hand"))
        session.hold({"push": 1.0})
        while session.time < 2.0:
            session.tick()
        most = session.look.row["bleeding_places"]
        session.restart()
        assert session.look.row["bleeding_places"] == 0
        session.hold({"push": 1.0})
        while session.time < 2.0:
            session.tick()
        assert session.look.row["bleeding_places"] == most
        session.hold({"push": -1.0})
        while session.time < 3.5:
            session.tick()
        session.close()
        recording = load_recording(folder)
        return recording, repeat(recording).exact


def test_what_bled_is_recorded_and_done_again_to_the_bit(bled):
    recording, exact = bled
    count = recording.rows["bleeding_places"]
    assert exact and count[0] == 0 < count[-1] and (np.diff(count) >= 0).all()
    row, frame = moment(recording, float(recording.rows["time"][-1]))
    blood = glance_at(row, frame).blood
    assert blood is not None and len(blood) == count[-1]
    first = int((count > 0).argmax())
    early = glance_at(*moment(recording, float(recording.rows["time"][max(first - 1, 0)]))).blood
    assert early is not None and not len(early)


def test_pictures_of_a_drive_show_blood(bled, colon_folder, scope):
    recording, _ = bled
    around = surroundings(colon_folder, scope)
    at = float(recording.rows["time"][-1])
    row, frame = moment(recording, at)
    without = {name: value for name, value in frame.items() if name != "blood"}
    eye = Eye(Camera(around, 96))
    pictures = [eye.draw(glance_at(row, drawn)).astype(float) for drawn in (without, frame)]
    redder(*pictures)
    films = [
        np.asarray(next(draw_pictures(around, np.array([at]), lambda _, drawn=drawn: (row, drawn))), float)
        for drawn in (without, frame)
    ]
    redder(*(film[:320, :320] for film in films))


@pytest.mark.parametrize("mesentery", [False, True])
def test_episodes_bleed_too_next_to_the_scope(colon_folder, monkeypatch, mesentery):
    monkeypatch.setattr(bleeding, "injury_number", lambda name: 20.0)
    task = TaskConfig(mesentery=mesentery).to_json()
    vehicle: Any = make_vehicle(colon_folder, {"kind": "episode", "task": task, "seed": 0, "policy": "follower"})
    push = np.array([1.0, 0.0, 0.0, 0.0])
    looks = [vehicle.look()]
    while looks[-1].row["time"] < 2.0:
        assert vehicle.step(push)
        looks.append(vehicle.look())
    counts = [look.row["bleeding_places"] for look in looks]
    assert counts[0] == 0 < counts[-1]
    kept = vehicle.keep()
    blood = glance_at(looks[-1].row, looks[-1].frame).blood
    assert blood is not None and len(blood) == counts[-1]
    away = np.linalg.norm(blood[:, None, :3] - looks[-1].frame["shape"], axis=2).min(axis=1)
    assert (away < 0.02).all(), "no farther from the scope than the lumen is wide"
    for step in (kept - 1, 0):
        vehicle.put_back(step)
        assert vehicle.look().row["digest"] == looks[step].row["digest"]
        assert vehicle.look().row["bleeding_places"] == counts[step]
    vehicle.close()


@pytest.fixture(scope="module")
def sucked(colon_folder, scope, tmp_path_factory):
    """Sucking in the middle of the lumen, then with the tip bent against the wall, and gently farther back."""
    folder = tmp_path_factory.mktemp("sucked")
    vehicle: Any = make_vehicle(colon_folder, scope)
    session = Session(vehicle, Recorder(folder, vehicle, driver="hand"))
    session.hold({"push": 0.5, "gas": -1.0})
    while session.time < 1.0:
        session.tick()
    session.hold({"push": 0.3, "up": 1.0})
    while session.time < 3.5:
        session.tick()
    told = []
    session.hold({"gas": -1.0})
    while session.time < 4.0:
        session.tick()
    told.append(vehicle.said)
    session.hold({"push": -0.5, "gas": -0.1})
    while session.time < 6.0:
        session.tick()
    session.close()
    recording = load_recording(folder)
    return recording, repeat(recording).exact, told


def test_suction_on_the_wall_bleeds_and_is_done_again_to_the_bit(sucked):
    recording, exact, told = sucked
    rows = recording.rows
    assert exact
    time, pull, count = rows["time"], rows["suction_pull"], rows["bleeding_pulled"]
    assert not pull[time < 0.9].any(), "in the middle of the lumen nothing lies over the channel"
    assert pull.max() == pytest.approx(60e3 + 2500, rel=0.02) and count[-1] == 1
    gently = (time > 4.1) & (pull > 0)
    assert np.ptp(rows["tip_arc"][gently]) > 0.02, "it sucks gently at other places too"
    assert pull[gently].max() == pytest.approx(6e3 + 2500, rel=0.1)
    assert told[0].startswith("suction: the wall bleeds at")
    bled = int(count.argmax())
    assert rows["bleeding_mm2"][[bled - 1, bled]].tolist() == pytest.approx([0.0, np.pi / 4 * 3.7**2])


def test_pictures_show_where_suction_made_the_wall_bleed(sucked, colon_folder, scope):
    recording, *_ = sucked
    row, frame = moment(recording, float(recording.rows["time"][-1]))
    blood = glance_at(row, frame).blood
    assert blood is not None and len(blood) == 1 and blood[0, 3] == pytest.approx(3.7e-3)
    tip = recording.rows["tip"][recording.rows["bleeding_pulled"].argmax()]
    assert np.linalg.norm(blood[0, :3] - tip) < 0.012, "next to the tip of then"
    around = surroundings(colon_folder, scope)
    line = around.colon.centreline
    beside = line.points[np.linalg.norm(line.points - blood[0, :3], axis=1).argmin() - 5]
    ahead = (blood[0, :3] - beside) / np.linalg.norm(blood[0, :3] - beside)
    left = np.cross(ahead, line.frames[0][:, 0])
    left /= np.linalg.norm(left)
    view = beside, np.column_stack([np.cross(left, ahead), left, ahead]), 0.07
    eye = Eye(Camera(around, 96))
    redder(*(eye.draw(Glance(*view, blood=given)).astype(float) for given in (None, blood)))


def redder(clean: np.ndarray, bloody: np.ndarray) -> None:
    """A picture is redder where it is darker than another."""
    darker = clean[..., 1] - bloody[..., 1] > 25
    assert darker.mean() > 0.005, "no blood is seen"
    was, now = ((one[darker][:, 0] / one[darker][:, 1:].mean(axis=1)).mean() for one in (clean, bloody))
    assert now > 1.3 * was
