"""`haustra evaluate` as a user calls it, in colons that the user brings."""

import json
from pathlib import Path

import pytest

from haustra.models.anatomy.store import save_colon
from haustra.scripts.main import BAD_INPUT, SUCCESS, main
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

pytest.importorskip("stable_baselines3")
pytest.importorskip("safetensors")

BENDS = {"left": 0.6, "right": -0.6}


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> list[str]:
    """Two short tubes as `haustra colon import` leaves them."""
    home = tmp_path_factory.mktemp("colons")
    parts = {name: winding([(0.08, 0.0), (0.08, turn), (0.12, 0.0)]) for name, turn in BENDS.items()}
    return [str(save_colon(swept_colon(path, name=name), home / name)) for name, path in parts.items()]


@pytest.fixture(autouse=True)
def own_cache(monkeypatch, tmp_path_factory):
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path_factory.getbasetemp() / "cache"))


def evaluate(output: Path, *options: str) -> int:
    design = ["--design", "paediatric", "--seconds", "10", "--episodes", "2", "--threads", "1"]
    return main(["evaluate", *options[:1], "-o", str(output), *design, *options[1:], "--json"])


def test_drivers_are_compared_in_the_colons_that_a_user_brings(folders, tmp_path, capsys):
    assert evaluate(tmp_path, "follower", "--no-video", "--colon-folders", *folders) == SUCCESS
    printed = json.loads(capsys.readouterr().out)["follower"]
    assert printed["episodes"] == 4
    assert list(printed["colons"]) == list(BENDS)
    assert all(colon["progress"] > 0.9 for colon in printed["colons"].values())
    episodes = json.loads((tmp_path / "episodes.json").read_text())["follower"]
    assert [one["colon"] for one in episodes] == ["left", "left", "right", "right"]
    assert (tmp_path / "evaluation.png").stat().st_size > 1000
    assert not list(tmp_path.glob("*.webp"))


def test_one_colon_gives_no_interval_over_colons(folders, tmp_path, capsys):
    assert evaluate(tmp_path, "push", "--colon-folders", folders[0], "--seconds", "1") == SUCCESS
    assert json.loads(capsys.readouterr().out)["push"]["progress_95"] is None
    (driver,) = json.loads((tmp_path / "evaluation.json").read_text())["drivers"]
    assert driver["completion_bootstrap"] is None and driver["completion_wilson"] == [
        0.0,
        pytest.approx(0.66, abs=0.01),
    ]


def test_folders_without_a_fitting_colon_are_refused_in_one_line(folders, tmp_path, capsys):
    short = save_colon(swept_colon(winding([(0.1, 0.0)]), name="short"), tmp_path / "short")
    twin = save_colon(swept_colon(winding([(0.28, 0.0)]), name="left"), tmp_path / "twin")
    bad = {
        "holds no colon": [str(tmp_path / "nowhere")],
        "bending section": [str(short)],
        "both named 'left'": [folders[0], str(twin)],
    }
    for words, colons in bad.items():
        assert evaluate(tmp_path / "out", "push", "--colon-folders", *colons) == BAD_INPUT
        error = capsys.readouterr().err.strip()
        assert words in error.splitlines()[-1]
