"""Instruments that a hand brings out: what is in reach is taken, bleeds, is gone from the picture, and comes back."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.console.channel import IN_CHANNEL, treated
from haustra.envs.console.painter import Camera, Eye, Glance
from haustra.envs.console.recording import Recorder, load_recording
from haustra.envs.console.replay import repeat
from haustra.envs.console.session import Session
from haustra.envs.console.source import glance_at, moment
from haustra.envs.console.vehicles import make_vehicle, surroundings
from haustra.models.anatomy.colon import Lesion
from haustra.models.anatomy.store import load_colon, save_colon


@pytest.fixture(scope="module")
def with_polyp(colon_folder, tmp_path_factory) -> Path:
    """The bent tube with a flat polyp on the wall that the tip looks at when its knob is turned up, cut into it."""
    from haustra.models.anatomy import lesion_shapes

    colon = load_colon(colon_folder)
    line = colon.centreline
    station = int(np.searchsorted(line.arc, 0.08))
    out = line.frames[station][:, 0]
    foot = line.points[station] + colon.radius[station, 0] * out
    polyp = Lesion("polyp", "flat", "small", 0.006, 0.002, "sigmoid", 0.08, 0.0, tuple(foot.tolist()))
    cut = lesion_shapes._solid(colon.lumen) - lesion_shapes._placed(lesion_shapes.lesion_outline(polyp), foot, -out)
    colon = replace(colon, lumen=lesion_shapes._surface(cut), lesions=(polyp,))
    return save_colon(colon, tmp_path_factory.mktemp("polyp"))


def _close(session: Session, instrument: str) -> None:
    for held in (instrument, f"{instrument} closed"):
        session.change("instrument", held)
        assert session.tick()


def test_a_polyp_is_taken_by_hand_bleeds_and_is_done_again_to_the_bit(with_polyp, scope, tmp_path):
    """With gas as when the colon was imaged, so that the polyp stays where it was."""
    full = scope["options"] | {"gas": 3333.0, "gas_start": 3333.0}
    vehicle = make_vehicle(with_polyp, scope | {"options": full})
    session = Session(vehicle, Recorder(tmp_path, vehicle, driver="hand"))
    _close(session, "snare")
    assert vehicle.said == "snare: too far" and session.look.row["polyps_taken"] == 0
    session.hold({"push": 0.3, "up": 0.5})
    while session.time < 1.0:
        session.tick()
    session.hold({"push": 0.3})
    while session.time < 4.0 and not session.look.row["polyps_taken"]:
        _close(session, "forceps")
    assert vehicle.said.startswith("forceps: a polyp of 6 mm; 5 mm² bleed"), vehicle.said
    bitten = session.step
    session.hold({})
    _close(session, "forceps")
    assert vehicle.said == "forceps: no polyp is left"
    _close(session, "snare")
    assert session.look.row["polyps_taken"] == 1
    assert session.look.row["bleeding_mm2"] == pytest.approx(np.pi / 4 * 8.0**2)
    for _ in range(110):
        session.tick()
    session.back(1.0)
    session.tick()
    session.close()
    recording = load_recording(tmp_path)
    assert repeat(recording).exact
    assert recording.rows["bleeding_mm2"][[bitten - 1, bitten]].tolist() == pytest.approx([0, np.pi / 4 * 2.4**2])
    row, frame = moment(recording, float(recording.rows["time"][-1]))
    tissue = glance_at(row, frame).tissue
    assert tissue is not None and tissue.tolist() == [2]


def test_a_cut_is_seen(with_polyp, scope):
    around = surroundings(with_polyp, scope)
    line, foot = around.colon.centreline, np.array(around.colon.lesions[0].position)
    tip = line.points[int(np.searchsorted(line.arc, 0.055))]
    ahead = (foot - tip) / np.linalg.norm(foot - tip)
    left = np.cross(ahead, line.frames[0][:, 0])
    frame = np.column_stack([np.cross(left, ahead), left, ahead]) / np.linalg.norm(left)
    frame[:, 2] = ahead
    eye = Eye(Camera(around, 96))

    def draw(tissue: int) -> np.ndarray:
        return eye.draw(Glance(tip, frame, 0.055, tissue=np.array([tissue]))).astype(int)

    pictures = [draw(tissue) for tissue in (0, 1, 2)]
    bloody = [int(((picture[..., 0] > 80) & (picture[..., 0] > 3 * picture[..., 1])).sum()) for picture in pictures]
    assert bloody[0] == 0 < bloody[1] < bloody[2] / 2, "blood lies as wide as what was taken"
    np.testing.assert_allclose(draw(0), pictures[0], atol=60, err_msg="whole again, but for the exposure")


def test_colons_without_polyps_have_nothing_to_take(colon_folder, scope):
    vehicle = make_vehicle(colon_folder, scope)
    assert "instrument" not in [one.name for one in vehicle.conditions] and vehicle.said == ""


def test_what_is_taken_is_gone_from_the_surface(with_polyp):
    colon = load_colon(with_polyp)
    assert treated(colon, [0]) is colon
    assert len(treated(colon, [1]).lesions) == 1 and not treated(colon, [2]).lesions
    assert len(treated(colon, [2]).lumen.faces) != len(colon.lumen.faces)
    assert IN_CHANNEL[0] == "none"
