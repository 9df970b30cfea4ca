"""`haustra run` as a user calls it."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from haustra.envs.runs.measure.scores import provenance_of, score
from haustra.models.anatomy.store import save_colon
from haustra.models.wall.pieces.store import save_wall
from haustra.provenance import Provenance
from haustra.scripts.main import BAD_INPUT, SUCCESS, main
from tests.tube_colon import straight_tube, wedge_wall

KEYS = {
    "outcome", "simulated_s", "wall_clock_s", "real_time_factor", "insertion_m", "tip_arc_m", "tip_segment",
    "push_force_peak_N", "torque_peak_Nm", "wall_force_peak_N", "dofs", "joints", "pieces", "timestep_s", "provenance",
    "backend", "wall_law", "mesentery", "numerical_error",
}  # fmt: skip


@pytest.fixture(scope="module")
def colon_folder(tmp_path_factory) -> Path:
    from haustra.models.anatomy.store import colon_hash

    folder = tmp_path_factory.mktemp("colon")
    colon = straight_tube()
    save_colon(colon, folder)
    wall = wedge_wall()
    fitting = Provenance(inputs={colon.name: colon_hash(colon)}, configuration={})
    save_wall(type(wall)(wall.method, wall.pieces, wall.error, fitting, {}), folder / "wall-prism")
    return folder


@pytest.fixture
def unwritten(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs are scored and no file is written of them, as the first test asks."""

    def scored(folder, *, scene, run, wall=None, seconds=None, error=None, **_):
        pieces = wall.method if wall else None
        about = provenance_of(scene, run, wall=pieces, seconds=seconds)
        return score(scene, run, about, wall=pieces, error=error)

    monkeypatch.setattr("haustra.envs.view.run_folder.write_run", scored)


def test_a_run_leaves_scores_trajectory_scene_pictures_and_a_report(colon_folder, tmp_path, capsys):
    arguments = [
        "run",
        "--colon",
        str(colon_folder),
        "--wall-law",
        "pieces",
        "--wall",
        "prism",
        "-o",
        str(tmp_path),
        "--seconds",
        "0.4",
        "--json",
    ]
    assert main(arguments) == SUCCESS
    printed = json.loads(capsys.readouterr().out)
    assert printed.keys() >= KEYS
    assert printed["simulated_s"] == pytest.approx(0.4)
    assert json.loads((tmp_path / "scores.json").read_text()) == printed
    for name in ("trajectory.npz", "scene.xml", "outside.png", "tip.png", "forces.png", "injury.png", "report.html"):
        assert (tmp_path / name).stat().st_size > 1000, name


def test_a_run_in_a_colon_that_moves(colon_folder, tmp_path, capsys, monkeypatch):
    """Without options: in linear time, by the lumen's table."""
    monkeypatch.setattr("haustra.envs.view.run_film._PICTURES", 2)
    call = ["run", "--colon", str(colon_folder), "--preset", "fast", "--seconds", "0.6"]
    assert main([*call, "-o", str(tmp_path), "--json", "--film"]) == SUCCESS
    with Image.open(tmp_path / "film.webp") as film:
        assert getattr(film, "n_frames", 1) == 2 and film.size == (640, 344)
    printed = json.loads(capsys.readouterr().out)
    assert printed["colon_moved_peak_mm"] > 0 and printed["pieces"] == 0
    options = printed["provenance"]["configuration"]["options"]
    assert options["mesentery"] and options["wall_law"] == "table"
    assert (tmp_path / "outside.png").stat().st_size > 1000
    assert main([*call, "-o", str(tmp_path / "fixed"), "--fixed", "--json"]) == SUCCESS
    assert json.loads(capsys.readouterr().out)["colon_moved_peak_mm"] == 0
    assert main([*call, "-o", str(tmp_path / "other"), "--wall-law", "planes", "--backend", "linear"]) == BAD_INPUT
    assert "backend linear has no wall law 'planes'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "preset"),
    [
        ([], "fast"),
        (["--timestep", "0.0025", "--elasticity", "exponential", "--friction-rise", "0.78"], "custom"),
        pytest.param(["--wall-law", "planes", "--fixed"], "fast", marks=pytest.mark.thorough),
    ],
)
def test_a_run_says_its_preset_its_wall_and_what_was_measured_of_its_error(
    options, preset, colon_folder, tmp_path, capsys, unwritten
):
    """An imported tube counts as a real colon; of a time step that is no preset's nobody has measured anything."""
    call = ["run", "--colon", str(colon_folder), "--wall", "prism", "--preset", "fast", "--seconds", "0.2"]
    assert main([*call, *options, "-o", str(tmp_path), "--json"]) == SUCCESS
    scores = json.loads(capsys.readouterr().out)
    assert scores["preset"] == scores["provenance"]["configuration"]["preset"] == preset
    assert scores["wall_law"] == ("planes" if "planes" in options else "table")
    assert scores["backend"] == ("native" if "planes" in options else "linear")
    assert scores["mesentery"] is ("--fixed" not in options)
    stated = scores["numerical_error"]
    if preset == "custom":
        modelled = scores["provenance"]["configuration"]["options"]
        assert (modelled["elasticity"], modelled["friction_rise"]) == ("exponential", 0.78)
        nothing = {"wall_force": [None, None], "push": [None, None], "tip_mm": [None, None]}
        assert stated == {**nothing, "measured_on": "not measured"}
    else:
        assert "real and grown colons" in stated["measured_on"]
        assert all(0 <= stated[name][0] <= stated[name][1] for name in ("wall_force", "push", "tip_mm"))


def test_a_run_measures_its_own_error(colon_folder, tmp_path, capsys):
    call = ["run", "--colon", str(colon_folder), "--wall-law", "planes", "--seconds", "0.2", "--error"]
    assert main([*call, "-o", str(tmp_path), "--json"]) == SUCCESS
    stated = json.loads(capsys.readouterr().out)["numerical_error"]
    assert stated["measured_on"] == "this run against half the time step and finer joints"
    assert stated["differences"].keys() == {"half the time step", "finer joints"}
    tips = sorted(each["tip_mm"] for each in stated["differences"].values())
    assert stated["tip_mm"] == tips and 0 < tips[1] < 5
    assert stated["push"][0] <= stated["push"][1] < 0.5
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Differences from its repeats" in page and "this run against half the time step" in page


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (["--device", "adlut"], "Known: adult, paediatric"),
        (["--start", "0.3"], "A scope starts at the anus"),
        (["--seconds", "-1"], "--seconds"),
        (["--friction", "-0.1"], "--friction is -0.1; give 0 to 10"),
        (["--timestep", "nan"], "timestep"),
        (["--elasticity", "cubic"], "elasticity 'cubic' is not known. Known: linear, exponential"),
        (["--elasticity", "exponential", "--wall-law", "planes"], "law 'table' has and 'planes' has not"),
        (["--colon", "no/such/folder"], "no/such/folder"),
        (["-o", "/proc/nowhere"], "/proc/nowhere"),
    ],
)
def test_bad_input_is_one_line_and_code_2(colon_folder, tmp_path, capsys, change, message):
    arguments = ["run", "--colon", str(colon_folder), "--wall", "prism", "-o", str(tmp_path / "run"), *change]
    assert main(arguments) == BAD_INPUT
    error = capsys.readouterr().err.strip()
    assert message in error
    assert len(error.splitlines()) == 1


def test_tangent_planes_need_no_wall_and_stiffen_by_segment(tmp_path, capsys, unwritten):
    save_colon(straight_tube(), tmp_path / "colon")
    arguments = ["run", "--colon", str(tmp_path / "colon"), "-o", str(tmp_path / "run"), "--seconds", "0.2", "--json"]
    assert main([*arguments, "--wall-law", "planes", "--segment-stiffness"]) == SUCCESS
    printed = json.loads(capsys.readouterr().out)
    assert printed["pieces"] == 0
    chosen = printed["provenance"]["configuration"]["options"]
    assert chosen["wall_law"] == "planes" and dict(chosen["segment_stiffness"])["caecum"] == 900
    assert main([*arguments, "--segment-stiffness", "--wall-law", "table"]) == BAD_INPUT
    assert "planes" in capsys.readouterr().err


def test_a_run_that_is_interrupted_leaves_the_one_before_and_nothing_else(colon_folder, tmp_path, monkeypatch, capsys):
    from haustra.envs.view import run_folder

    monkeypatch.setattr(run_folder, "outside_view", lambda *_, **__: np.zeros((8, 8, 3), np.uint8))
    call = ["run", "--colon", str(colon_folder), "--preset", "fast", "-o", str(tmp_path / "old"), "--json"]
    assert main([*call, "--seconds", "0.1"]) == SUCCESS
    before = {path.name: path.read_bytes() for path in (tmp_path / "old").iterdir()}

    def stopped(*_args, **_options):
        raise KeyboardInterrupt

    capsys.readouterr()
    monkeypatch.setattr(run_folder, "time_figure", stopped)
    assert main([*call, "--seconds", "0.2"]) == 130
    assert {path.name: path.read_bytes() for path in (tmp_path / "old").iterdir()} == before
    assert "what was finished is kept" in capsys.readouterr().err
    assert main([*call[:-2], str(tmp_path / "made" / "new"), "--json", "--seconds", "0.1"]) == 130
    assert "nothing was written" in capsys.readouterr().err
    assert not (tmp_path / "made").exists()


@pytest.mark.thorough
def test_warnings_of_a_colon_reach_scores_and_report(tmp_path, capsys):
    colon = replace(straight_tube(), warnings=("The end is <b>blind</b>.",))
    save_colon(colon, tmp_path / "colon")
    for device in ("adult", "capsule"):
        call = ["run", "--colon", str(tmp_path / "colon"), "--device", device, "-o", str(tmp_path / device), "--json"]
        assert main([*call, "--seconds", "0.5"]) == SUCCESS
        assert json.loads(capsys.readouterr().out)["warnings"] == ["The end is <b>blind</b>."]
        assert "The end is &lt;b&gt;blind&lt;/b&gt;." in (tmp_path / device / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--gravity", "1e9", "0", "0"], "--gravity[0] is 1000000000.0; give -100 to 100 m/s^2."),
        (["--seconds", "1e-9"], "--seconds is 1e-09; give 0.02 to 36000 s."),
        (["--seconds", "nan"], "--seconds is nan; give 0.02 to 36000 s."),
        (["--timestep", "1"], "--timestep is 1.0; give 1e-05 to 0.02 s (is it in ms?)."),
        (["--push-limit", "inf"], "--push-limit is inf; give 0.01 to 1000 N."),
    ],
)
def test_an_option_out_of_its_range_is_refused_and_leaves_nothing(words, said, tmp_path, capsys):
    call = ["run", "--colon", str(tmp_path), "-o", str(tmp_path / "a" / "b"), *words]
    assert main(call) == BAD_INPUT
    assert capsys.readouterr().err == f"haustra: {said}\n"
    assert not (tmp_path / "a").exists()


def test_a_driver_that_is_not_known_or_does_not_honour_an_option_is_refused_in_one_line(colon_folder, tmp_path, capsys):
    call = ["run", "--colon", str(colon_folder), "-o", str(tmp_path / "run")]
    refused = {
        "Driver 'nobody' is not known. Known: follower, endoscopist, insertion": ["--driver", "nobody"],
        "draws nothing: leave the seed out": ["--seed", "3"],
        "A policy asks for pulls": ["--driver", "insertion-easy", "--steer", "wheels"],
        "A policy inserts on the backend linear": ["--driver", "insertion-easy", "--backend", "native"],
        "colons of fixed width": ["--driver", "insertion-easy", "--insufflate", "25mmHg"],
    }
    for message, options in refused.items():
        assert main([*call, *options]) == BAD_INPUT
        said = capsys.readouterr().err
        assert message in said and said.splitlines()[-1].startswith("haustra: ")
    assert not (tmp_path / "run").exists()


def test_a_policy_drives_the_scope_that_it_was_trained_with(colon_folder, tmp_path, capsys, monkeypatch, unwritten):
    """Without torch, of which nothing is needed."""
    monkeypatch.setitem(sys.modules, "torch", None)
    call = ["run", "--colon", str(colon_folder), "--driver", "insertion-easy", "--seconds", "0.5"]
    assert main([*call, "-o", str(tmp_path), "--json"]) == SUCCESS
    printed = json.loads(capsys.readouterr().out)
    made = printed["provenance"]["configuration"]
    assert printed["outcome"] == "time_up" and printed["simulated_s"] == pytest.approx(0.5, abs=0.12)
    assert made["design"]["name"] == "paediatric-long" and made["driver"]["policy"] == "insertion-easy"
    assert made["driver"]["sampled"] and len(made["driver"]["weights"]) > 8
