"""`haustra run --device tracked`: what a person gets from it, and what is refused."""

import json
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from haustra.assets import assets
from haustra.models.anatomy.colon import Centreline, Colon, ColonSegment
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import save_colon
from haustra.scripts.main import main


@pytest.fixture(scope="module")
def colon(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tracked") / "colon"
    folder.mkdir()
    save_colon(stretch(grow_colon(seed=0), 0.36, 0.45), folder)
    return folder


def stretch(colon: Colon, low: float, high: float) -> Colon:
    """Only these arc lengths [m], so that its table is quick to make; the lumen stays whole."""
    line = colon.centreline
    kept = (line.arc >= low) & (line.arc <= high)
    arc = line.arc[kept] - line.arc[kept][0]
    return replace(
        colon,
        centreline=Centreline(line.points[kept], arc, line.frames[kept]),
        radius=colon.radius[kept],
        segments=(ColonSegment("sigmoid", 0.0, float(arc[-1])),),
    )


def changed(tmp_path: Path, old: str, new: str) -> str:
    text = assets("devices", ".toml")["tracked"].read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "mine.toml").write_text(text.replace(old, new), encoding="utf-8")
    return str(tmp_path / "mine.toml")


def run(colon: Path, folder: Path, *options: str) -> int:
    usual = {"--device": "tracked", "--start": "0.04"}
    usual |= dict(zip(options[::2], options[1::2], strict=True))
    return main(
        ["run", "--colon", str(colon), "-o", str(folder), "--json", *[w for pair in usual.items() for w in pair]]
    )


def test_it_drives_and_leaves_what_every_device_leaves(
    colon: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """At 8.1 mm/s in 0.8 s."""
    assert run(colon, tmp_path, "--seconds", "0.8") == 0
    scores = json.loads(capsys.readouterr().out)
    assert scores["outcome"] == "time_up"
    assert scores["device_kind"] == "tracked" and scores["backend"] == "native" and scores["wall_law"] == "table"
    assert 0.7 < (scores["tip_arc_m"] - 0.04) / (0.8 * 0.00325 * 150 / 60) < 1.1
    assert 0 < scores["worm_torque_peak_Nm"] < 0.0015625 and scores["normal_mean_N"] > 0.3
    assert scores["mesentery"] is True and "flexible shaft" in scores["not_modelled"]
    assert json.loads((tmp_path / "scores.json").read_text())["tip_arc_m"] == scores["tip_arc_m"]
    for name in ("trajectory.npz", "scene.xml", "outside.png", "device.png", "tip.png", "report.html"):
        assert (tmp_path / name).stat().st_size > 1000, name
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    with np.load(tmp_path / "trajectory.npz") as kept:
        np.testing.assert_allclose(model.key_qpos[0], kept["qpos"][-1], atol=1e-6)
    assert "tracked, tracked-wide" in scores["numerical_error"]["measured_on"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--start", "0.01"], "cannot stand at -12 mm"),
        (["--friction", "-1"], "--friction is -1.0"),
        (["--preset", "fast"], "does not honour --preset"),
        (["--timestep", "0.005"], "give up to 0.002 s"),
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
        ("at_scale = 0", "at_scale is 0; give 0.05 to 20"),
        ('at_scale = "big"', "at_scale is 'big'; give 0.05 to 20"),
    ],
)
def test_sizes_that_cannot_be_are_one_line(
    colon: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], new: str, message: str
) -> None:
    assert run(colon, tmp_path / "run", "--device", changed(tmp_path, "at_scale = 1.0", new)) == 2
    assert message in " ".join(capsys.readouterr().err.split())
