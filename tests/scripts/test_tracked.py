"""`haustra run --device tracked`: what a person gets from it, and what is refused."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from haustra.assets import assets
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


def changed(tmp_path: Path, old: str, new: str) -> str:
    text = assets("devices", ".toml")["tracked"].read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "mine.toml").write_text(text.replace(old, new), encoding="utf-8")
    return str(tmp_path / "mine.toml")


def run(colon: Path, folder: Path, *options: str) -> int:
    usual = {"--device": "tracked", "--start": "0.03", "--wall": "prism"}
    usual |= dict(zip(options[::2], options[1::2], strict=True))
    return main(
        ["run", "--colon", str(colon), "-o", str(folder), "--json", *[w for pair in usual.items() for w in pair]]
    )


def test_it_drives_and_leaves_what_every_device_leaves(
    colon: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """For longer than the same device is held to read its pull."""
    assert run(colon, tmp_path, "--seconds", "3.5") == 0
    scores = json.loads(capsys.readouterr().out)
    assert scores["outcome"] == "time_up" and scores["ended_by"] == "time"
    assert scores["device_kind"] == "tracked" and scores["backend"] == "native" and scores["wall_law"] == "pieces"
    assert 0.6 < scores["driven_share"] < 1.3
    assert 0.05 < scores["pull_N"] < 1.0
    assert 0 < scores["fits_share_of_colon"] <= 1
    assert 0 < scores["held_worm_torque_peak_Nm"] < scores["worm_torque_limit_Nm"]
    assert {"friction by speed", "flexible shaft", "mesentery", "weight"} <= set(scores["not_modelled"])
    assert json.loads((tmp_path / "scores.json").read_text())["driven_mm"] == scores["driven_mm"]
    for name in ("trajectory.npz", "scene.xml", "outside.png", "report.html"):
        assert (tmp_path / name).stat().st_size > 1000, name
    assert scores["numerical_error"]["measured_on"] == "not measured"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--start", "0.0"], "cannot stand at 0 mm"),
        (["--friction", "-1"], "Tread friction is -1"),
        (["--seconds", "0.1"], "--seconds is 0.1"),
        (["--wall-law", "table"], "cannot meet wall law 'table'. It can meet: pieces"),
        (["--timestep", "0.001"], "does not honour --timestep"),
    ],
)
def test_what_it_cannot_do_is_one_line(
    colon: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    assert run(colon, tmp_path / "run", *options) == 2
    assert message in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("new", "message"),
    [
        ("at_scale = 4.0", "is longer than the 88 mm of colon"),
        ("at_scale = 0.5", "it fits nowhere in this colon; scale the design"),
        ("at_scale = 0", "Scale 0.0 is not a positive number"),
        ('at_scale = "big"', "at_scale: expected a number, found 'big'"),
    ],
)
def test_sizes_that_cannot_be_are_one_line(
    colon: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], new: str, message: str
) -> None:
    assert run(colon, tmp_path / "run", "--device", changed(tmp_path, "at_scale = 1.0", new)) == 2
    assert message in " ".join(capsys.readouterr().err.split())
