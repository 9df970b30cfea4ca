"""The bench verbs: rows with the documented keys, and one line for bad input."""

import json

import pytest

from haustra.scripts.bench.pages.cable_page import cable_page
from haustra.scripts.main import BAD_INPUT, SUCCESS, main


@pytest.fixture
def small_folder(tmp_path, shared_data):
    """Three shapes and the first half second of one release."""
    source = shared_data / "rods"
    (tmp_path / "rod.toml").write_bytes((source / "rod.toml").read_bytes())
    shapes = (source / "SpringSteelRodMuJoCo_dataStatics.csv").read_text().splitlines()
    (tmp_path / "a_dataStatics.csv").write_text("\n".join(shapes[: 2 + 3 * 6]))
    motion = (source / "SpringSteelRodMuJoCo_1.txt").read_text().splitlines()
    (tmp_path / "a_1.txt").write_text("\n".join(motion[:102]))
    return tmp_path


def test_rods_give_rows_with_the_documented_keys(small_folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["bench", "rods", str(small_folder), "--joints", "12,6", "-o", str(out), "--json"]) == SUCCESS
    result = json.loads(capsys.readouterr().out)
    assert [row["joints"] for row in result["rows"]] == [6, 12]
    for row in result["rows"]:
        assert set(row) == {"joints", "statics_mean_tip_error", "statics_max_tip_error", "dynamics"}
        assert [set(each) for each in row["dynamics"]] == [{"file", "mid_rms", "tip_rms"}]
        assert 0 < row["statics_mean_tip_error"] <= row["statics_max_tip_error"] < 0.02
    assert (out / "a_1.png").stat().st_size > 10_000
    assert json.loads((out / "rods.json").read_text()) == result


@pytest.mark.parametrize("joints", ["", "a,b", "1", "5000", "2.5"])
def test_impossible_numbers_of_joints_are_refused(joints, tmp_path, capsys):
    assert main(["bench", "rods", str(tmp_path), f"--joints={joints}", "--json"]) == BAD_INPUT
    assert "--joints" in capsys.readouterr().err


def test_a_missing_folder_is_refused(tmp_path, capsys):
    assert main(["bench", "rods", str(tmp_path / "none"), "--json"]) == BAD_INPUT
    assert capsys.readouterr().err.count("\n") == 1


def test_cost_compares_three_rods(capsys):
    assert main(["bench", "cost", "--joints", "6,8", "--json"]) == SUCCESS
    result = json.loads(capsys.readouterr().out)
    for row in result["alone"]:
        for kind in ("hinges", "cable plugin", "1D flex", "plain chain"):
            assert row[kind]["real_time_factor"] == pytest.approx(row[kind]["steps_per_s"] * result["timestep_s"])


def test_the_page_shows_every_figure(small_folder, capsys):
    main(["bench", "rods", str(small_folder), "--joints", "6", "--json"])
    rods = json.loads(capsys.readouterr().out)
    main(["bench", "cost", "--joints", "6", "--json"])
    cost = json.loads(capsys.readouterr().out)
    page = cable_page([["a figure", "1.01", "1", "0.01", "0.02"]], rods, cost)
    assert "| a figure | 1.01 | 1 | 1.00% | 2.00% |" in page
    assert f"{100 * rods['rows'][0]['statics_mean_tip_error']:.3f} %" in page


@pytest.mark.parametrize("option", ["--seconds=0", "--seeds=-1", "--patience=0.5", "--colons=0", "--until=-1"])
def test_impossible_searches_by_gradient_are_refused(option, capsys):
    assert main(["bench", "gradients", option, "--json"]) == BAD_INPUT
    assert option.partition("=")[0] in capsys.readouterr().err


@pytest.mark.thorough
def test_pictures_of_a_moving_scope_give_rows_with_their_rate(capsys):
    about = ["--triangles", "60000", "--width", "32", "--height", "32", "--joints", "40", "--no-opengl"]
    assert main(["bench", "view", *about, "--json"]) == SUCCESS
    result = json.loads(capsys.readouterr().out)
    assert [(row["renderer"], row["joints"]) for row in result["rows"]] == [("rays", 40)]
    assert result["rows"][0]["frames_per_s"] > 0 and result["rows"][0]["triangles"] >= 60_000
