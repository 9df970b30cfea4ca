"""Scores of an imager's recording, on shapes whose answer is known, and of a run beside its own."""

import json
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.runs.imager_files import CAECUM, SPLENIC, START, ImagerRecording
from haustra.envs.runs.measure.imager import imager_scores
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.store import save_colon
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.scripts.main import BAD_INPUT, SUCCESS, main
from tests.tube_colon import straight_tube

TIME = 0.1 * np.arange(50)
BEHIND = 0.1 * np.arange(12)


def _loop(arc: np.ndarray, hand: float) -> np.ndarray:
    """Places along a way that goes 0.3 m up, once round an axis from front to back with a radius of 8 cm, and up."""
    radius, before = 0.08, np.minimum(arc, 0.3)
    turn = np.clip((arc - 0.3) / radius, 0.0, 2 * np.pi)
    after = np.maximum(arc - 0.3 - 2 * np.pi * radius, 0.0)
    up = before + radius * np.sin(turn) + after
    across = radius * (1 - np.cos(turn)) - 0.03 * turn / (2 * np.pi)
    return np.stack([across, hand * 0.02 * turn / np.pi, up], axis=-1)


@pytest.mark.parametrize(("hand", "name"), [(1.0, "alpha"), (-1.0, "reversed_alpha")])
def test_a_loop_is_named_by_its_hand(hand: float, name: str) -> None:
    """Clockwise torque undoes a right-handed crossing, seen from the front; the tip's own path is the shaft's."""
    inserted = np.linspace(0.0, 1.1, 50)
    places = _loop(inserted[:, None] - BEHIND, hand)
    found = imager_scores(ImagerRecording(TIME, places))
    assert found["insertion_max_m"] == pytest.approx(1.1, abs=0.03)
    assert found[f"loop_{name}_s"] > 0.9
    assert found[f"loop_{'alpha' if hand < 0 else 'reversed_alpha'}_s"] == 0.0
    assert found["cops3d_travel_length_m"] == pytest.approx(1.1, rel=0.03)
    assert found["cops_landmarks"] is None and not found["reached_caecum"]


def test_insertion_is_judged_from_the_start_to_the_caecum() -> None:
    """What came before and after is left out; the landmarks say how far the tip had come."""
    inserted = np.interp(TIME, [0, 1, 4, 4.9], [0, 0, 0.7, 0])
    places = np.zeros((50, 12, 3))
    places[..., 2] = inserted[:, None] - BEHIND
    events = {START: 1.0, SPLENIC: 2.5, CAECUM: 4.0}
    found = imager_scores(ImagerRecording(TIME, places, events))
    assert found["seconds"] == pytest.approx(3.0, abs=0.11) and found["reached_caecum"]
    assert found["cops3d_travel_length_m"] == pytest.approx(0.7, abs=0.03)
    assert 45 < found["cops_landmarks"] < 60
    with pytest.raises(InvalidOptionError, match="never gets 5 cm in"):
        imager_scores(ImagerRecording(TIME, places[:5].repeat(10, axis=0)))


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a scope that is pushed straight on by 50 cm, as `haustra run` leaves it."""
    folder = tmp_path_factory.mktemp("run")
    save_colon(straight_tube(), folder / "colon")
    scene = build_scene(straight_tube(), None, named_design("adult"), SceneOptions(wall_law="table"), show_lumen=False)
    scene.save(folder / "scene.xml")
    model = scene.compile()
    time = 0.02 * np.arange(1, 501)
    qpos = np.zeros((500, model.nq))
    qpos[:, 0] = np.linspace(0.0, 0.5, 500)
    np.savez(folder / "trajectory.npz", time=time, qpos=qpos, tip_arc=0.03 + qpos[:, 0])
    return folder


def test_a_run_is_exported_and_scored(run_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["imager", "export", str(run_folder), "-o", str(tmp_path), "--json"]) == SUCCESS
    exported = json.loads(capsys.readouterr().out)
    assert exported["records"] == 100 and exported["coils"] >= 6
    assert main(["imager", "score", str(tmp_path), "--json"]) == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert found["insertion_max_m"] == pytest.approx(0.5, abs=0.01)
    assert found["coil_spacing_m"] == pytest.approx(0.1, abs=1e-4)
    assert found["cops3d_tip_progression"] == pytest.approx(1.0, abs=0.02)
    assert found["loop_N_s"] == found["loop_alpha_s"] == 0.0


def test_what_cannot_be_exported_is_refused(
    run_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ["imager", "export", str(run_folder), "-o", str(tmp_path / "out")]
    assert main([*call, "--interval", "0.01"]) == BAD_INPUT
    assert main([*call, "--colon", str(run_folder / "colon")]) == BAD_INPUT  # no scores.json says which colon it was
    assert main(["imager", "export", str(tmp_path), "-o", str(tmp_path / "out")]) == BAD_INPUT
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 3 and "every 0.02 s" in said[0] and "scores.json" in said[1] and "scene.xml" in said[2]
    assert not (tmp_path / "out").exists()
