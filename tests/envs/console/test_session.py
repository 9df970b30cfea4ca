"""Drives by a hand and a driver: what is recorded is done again to the bit, whatever happened in between."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from haustra.envs.console import recording as recordings
from haustra.envs.console import scope_vehicle
from haustra.envs.console.recording import Recorder, load_recording
from haustra.envs.console.replay import repeat
from haustra.envs.console.session import KNOB_RATE, KNOB_RETURN, LET_GO, Session
from haustra.envs.console.vehicles import make_vehicle
from haustra.envs.control.laws import driver_settings
from haustra.errors import InvalidOptionError, OutputError, UnreadableFileError


def _run(session: Session, seconds: float) -> None:
    for _ in range(round(seconds / session.vehicle.interval)):
        assert session.tick()


@pytest.fixture(scope="module")
def driven(colon_folder, scope, tmp_path_factory) -> Path:
    """A follower that is corrected, conditions that change, a way that is taken anew; in chunks of half a second."""
    folder = tmp_path_factory.mktemp("drive")
    vehicle = make_vehicle(colon_folder, scope)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recordings, "CHUNK_SECONDS", 0.5)
        session = Session(vehicle, Recorder(folder, vehicle, driver="follower"), assisted=True)
    _run(session, 1.2)
    session.hold({"push": -0.5, "up": 1.0, "gas": 1.0, "water": 1.0})
    _run(session, 0.4)
    session.hold({})
    _run(session, 0.3)
    session.change("friction", 0.3)
    _run(session, 0.3)
    session.back(0.9)
    assert session.step == 50, "the last state that was kept is that of the first second"
    assert session.conditions()["friction"] == pytest.approx(0.1)
    _run(session, 0.3)
    session.hold({"push": -1.0})
    _run(session, 0.2)
    session.hold({})
    session.change("posture", "left")
    session.change("wall_stiffness", 2000.0)
    _run(session, 0.5)
    assert session.close()["finished"]
    return folder


def test_a_corrected_drive_is_repeated_to_the_bit(driven):
    recording = load_recording(driven)
    assert len(list(driven.glob("rows-*.npz"))) > 4
    assert recording.rows["time"][-1] == pytest.approx(2.0)
    assert repeat(recording).exact
    levers = np.array(recording.rows["levers"])
    levers[60, 0] += 1e-9
    changed = type(recording)(driven, recording.about, {**recording.rows, "levers": levers}, recording.frames)
    assert repeat(changed).first_difference == 60


def test_water_is_poured_while_its_lever_is_held_and_sucked_out_first(colon_folder, scope):
    """At 0.3 L/min, in steps of 0.1 s; what was kept before is without it again; the lever pours and never draws."""
    vehicle = make_vehicle(colon_folder, scope)
    session = Session(vehicle)
    _run(session, 0.4)
    kept = vehicle.keep()
    session.hold({"water": 1.0})
    _run(session, 1.0)
    full = session.look.row["water_volume"]
    assert full == pytest.approx(5e-6, abs=1e-6)
    session.hold({"water": -1.0})
    _run(session, 0.4)
    assert session.look.row["water_volume"] == pytest.approx(full, abs=1e-6)
    session.hold({"gas": -1.0})
    _run(session, 0.6)
    left = vehicle.look().row
    assert left["water_volume"] < full - 1e-6
    vehicle.put_back(kept)
    assert vehicle.look().row["water_volume"] == 0.0


def test_the_moment_of_a_correction_is_recorded(driven):
    """Only that of the way which was taken in the end; the driver has the lever again a moment after."""
    recording = load_recording(driven)
    rows, push = recording.rows, recording.levers.index("push")
    (begun,) = recording.corrections()
    assert begun == pytest.approx(1.0 + 0.3 + recording.interval)
    held = np.flatnonzero(rows["by_person"][:, push])
    assert len(held) == pytest.approx((0.2 + LET_GO) / recording.interval, abs=1.5)
    assert (rows["levers"][held[:10], push] == -0.06).all()
    free = ~rows["by_person"][:, push] & rows["assisted"]
    np.testing.assert_array_equal(rows["levers"][free, push][1:], rows["proposed"][free, push][1:])


def test_an_endoscopist_helps_and_its_assistant_is_recorded(colon_folder, scope, tmp_path, monkeypatch):
    """Attempts that fail quickly: a hand on the belly, then the patient turned, all of it done again to the bit."""
    hasty: dict[str, Any] = {
        "patience": 0.3,
        "calm": 0.1,
        "rest": 0.1,
        "jiggle_time": 0.1,
        "least_pull": 1e-3,
        "most_pull": 0.01,
        "suck_after": 1.0,
    }
    monkeypatch.setattr(scope_vehicle, "driver_settings", lambda name, **about: driver_settings(name, **about, **hasty))
    vehicle = make_vehicle(colon_folder, {**scope, "driver": "endoscopist"})
    session = Session(vehicle, Recorder(tmp_path, vehicle, driver="endoscopist"), assisted=True)
    _run(session, 6.0)
    session.close()
    recording = load_recording(tmp_path)
    assert recording.about["vehicle"]["driver"] == "endoscopist"
    pressed = recording.rows["conditions"][:, [one.name for one in vehicle.conditions].index("pressed")]
    assert np.ptp(pressed) > 0
    assert recording.rows["levers"][:, vehicle.lever("gas")].min() == -1  # it sucks, too
    assert repeat(recording).exact


def test_knobs_stay_where_they_are_unless_they_are_unlocked(colon_folder, scope):
    vehicle = make_vehicle(colon_folder, scope)
    session = Session(vehicle)
    up = vehicle.lever("up")
    session.hold({"up": 1.0})
    _run(session, 0.5)
    session.hold({})
    _run(session, 0.2)
    assert session.hand.knobs[up] == pytest.approx(0.5 * KNOB_RATE)
    session.hand.locked[up] = False
    _run(session, 0.2)
    assert session.hand.knobs[up] == pytest.approx(0.5 * KNOB_RATE - 0.2 * KNOB_RETURN)
    with pytest.raises(InvalidOptionError, match="Lever 'brake' is not known"):
        session.hold({"brake": 1.0})
    with pytest.raises(InvalidOptionError, match="friction is 9"):
        session.change("friction", 9)
    with pytest.raises(InvalidOptionError, match="Place 'there' is not marked"):
        session.restart("there")


def test_any_device_with_controls_is_driven_and_repeated(colon_folder, capsule, tmp_path):
    vehicle = make_vehicle(colon_folder, capsule)
    session = Session(vehicle, Recorder(tmp_path, vehicle, driver="its own"), assisted=True)
    _run(session, 1.2)
    session.change("friction", 0.3)
    session.hold({"force_x": -1.0})
    _run(session, 0.3)
    session.back(0.4)
    _run(session, 0.5)
    session.close()
    recording = load_recording(tmp_path)
    assert np.ptp(recording.rows["tip"], axis=0).max() > 1e-3
    assert repeat(recording).exact


def test_a_recording_with_other_levers_is_refused(driven):
    known = load_recording(driven)
    fewer = {"levers": known.about["levers"][:-1]}
    older = replace(known, about={**known.about, **fewer})
    with pytest.raises(UnreadableFileError, match=r"was recorded with the levers .* now: record it again"):
        repeat(older)


def test_a_recording_that_was_cut_off_is_kept_and_a_damaged_one_is_refused(driven, capsule, tmp_path):
    import shutil

    copy = tmp_path / "copy"
    shutil.copytree(driven, copy)
    whole = len(load_recording(copy).rows["step"])
    sorted(copy.glob("rows-*.npz"))[-1].unlink()
    assert 0 < len(load_recording(copy).rows["step"]) < whole
    sorted(copy.glob("rows-*.npz"))[1].unlink()
    with pytest.raises(UnreadableFileError, match="steps are missing"):
        load_recording(copy)
    sorted(copy.glob("rows-*.npz"))[0].write_bytes(b"PK nothing")
    with pytest.raises(UnreadableFileError, match="damaged"):
        load_recording(copy)
    about = json.loads((copy / "recording.json").read_text())
    (copy / "recording.json").write_text(json.dumps(about | {"format": "another"}))
    with pytest.raises(UnreadableFileError, match="record it again"):
        load_recording(copy)
    with pytest.raises(OutputError, match="holds a recording already"):
        Recorder(driven, make_vehicle(driven / "colon", capsule), driver="hand")
