"""`haustra tracked`: what a person gets from it, and what is refused."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import colon_hash, load_colon, save_colon
from haustra.models.wall.pieces.store import save_wall
from haustra.provenance import Provenance
from haustra.scripts.main import main
from tests.envs.runs.test_tracked_drive import stretch
from tests.ring_wall import ring_wall


@pytest.fixture(scope="module")
def colon(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tracked") / "colon"
    folder.mkdir()
    part = stretch(grow_colon(seed=0), 0.36, 0.45)
    save_colon(part, folder)
    made_of = Provenance(inputs={"colon": colon_hash(load_colon(folder))}, configuration={})
    save_wall(replace(ring_wall(part), provenance=made_of), folder / "wall-prism")
    return folder


def test_it_drives_and_leaves_scores_and_a_picture(
    colon: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """For longer than the same device is held to read its pull."""
    assert (
        main(["tracked", "--colon", str(colon), "--arc", "0.03", "--seconds", "3.5", "-o", str(tmp_path), "--json"])
        == 0
    )
    scores = json.loads(capsys.readouterr().out)
    assert scores["outcome"] == "completed"
    assert scores["ended_by"] == "time"
    assert 0.6 < scores["driven_share"] < 1.3
    assert 0.05 < scores["pull_N"] < 1.0
    assert 0 < scores["fits_share_of_colon"] <= 1
    assert json.loads((tmp_path / "scores.json").read_text())["driven_mm"] == scores["driven_mm"]
    assert scores["wall_law"] == "pieces" and scores["numerical_error"]["measured_on"] == "not measured"
    assert (tmp_path / "outside.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--arc", "0.0"], "cannot stand at 0 mm"),
        (["--arc", "0.03", "--scale", "4"], "is longer than the 88 mm of colon"),
        (["--arc", "0.03", "--scale", "0.5"], "it fits nowhere in this colon; scale the design"),
        (["--arc", "0.03", "--friction", "-1"], "Tread friction is -1"),
        (["--arc", "0.03", "--seconds", "0.1"], "--seconds is 0.1"),
        (["--arc", "0.03", "--rpm", "-5"], "--rpm is -5"),
        (["--arc", "0.03", "--scale", "0"], "Scale 0.0 is not a positive number"),
    ],
)
def test_what_it_cannot_do_is_one_line(
    colon: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    assert main(["tracked", "--colon", str(colon), "-o", str(tmp_path / "run"), *options]) == 2
    error = capsys.readouterr().err
    assert message in " ".join(error.split())
