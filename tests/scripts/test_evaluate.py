"""`haustra evaluate` as a user calls it, in colons that the user brings."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.learning.eyes import COLOURS, RAYS, Eyes
from haustra.envs.learning.policy import MlpPolicy, save_policy
from haustra.envs.learning.recall import recalled_width
from haustra.envs.tasks.config import Drive, TaskConfig
from haustra.envs.tasks.observation import LUMEN_SIZE, sizes
from haustra.models.anatomy.store import save_colon
from haustra.models.wall.cache import cache_folder
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
    """But for programs, which are compiled once for all tests: they are found again by all that they hold."""
    own, programs = tmp_path_factory.getbasetemp() / "cache", cache_folder() / "linear"
    if not own.exists():
        own.mkdir()
        programs.mkdir(parents=True, exist_ok=True)
        (own / "linear").symlink_to(programs)
    monkeypatch.setenv("HAUSTRA_CACHE", str(own))


@pytest.fixture
def undrawn(monkeypatch):
    """Evaluations without their picture, which the first test looks at."""
    monkeypatch.setattr("haustra.envs.learning.figures.draw_evaluations", lambda *_: None)


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


def test_policies_that_see_and_decide_otherwise_are_compared_in_one_call(folders, tmp_path, capsys, undrawn):
    """Pictures of another size, no colours at all, another interval: each as it was trained, none refused."""
    see = {"a": TaskConfig(observation="pixels", picture_size=16, stool=0.2), "b": TaskConfig(observation="state")}
    see["c"] = replace(see["a"], picture_size=24, drive=replace(Drive(), control_interval=0.08))
    for name, config in see.items():
        save_policy(tmp_path / name, idle(config))
    assert side_by_side(tmp_path / "out", [tmp_path / name for name in see], folders[0], "0.3") == SUCCESS
    assert [one["episodes"] for one in json.loads(capsys.readouterr().out).values()] == [1, 1, 1]


def test_a_policy_that_recalls_does_beside_a_quicker_one_what_it_does_alone(folders, tmp_path, undrawn):
    quick = idle(TaskConfig(observation="lumen"))
    slow = idle(replace(quick.config, drive=replace(Drive(), control_interval=0.2)), recalls=(1.0,))
    paths = [tmp_path / "quick", tmp_path / "slow"]
    for path, policy in zip(paths, (quick, slow), strict=True):
        save_policy(path, policy)
    assert side_by_side(tmp_path / "alone", paths[1:], folders[0], "2") == SUCCESS
    assert side_by_side(tmp_path / "both", paths, folders[0], "2") == SUCCESS
    alone, both = (json.loads((tmp_path / name / "episodes.json").read_text()) for name in ("alone", "both"))
    assert alone[str(paths[1])] == both[str(paths[1])]


def side_by_side(output: Path, policies: list[Path], colon: str, seconds: str) -> int:
    options = ["--no-video", "--episodes", "1", "--threads", "1", "--json", "--colon-folders", colon]
    return main(["evaluate", *map(str, policies), "-o", str(output), "--seconds", seconds, *options])


def idle(config: TaskConfig, recalls: tuple[float, ...] = ()) -> MlpPolicy:
    """A policy of one layer drawn at random, with eyes where it sees pictures."""
    sees = config.observation == "pixels"
    seen = LUMEN_SIZE if sees else sum(shape[0] for shape in sizes(config).values())
    weights = np.random.default_rng(0).normal(0.0, 0.1, (4, recalled_width(seen, 4, len(recalls))))
    layers = (weights.astype(np.float32),), (np.zeros(4, np.float32),)
    return MlpPolicy(*layers, "tanh", False, config, recalls=recalls, eyes=blank(config.picture_size) if sees else None)


def blank(size: int) -> Eyes:
    """Eyes that see the same in every picture."""
    kernels, hidden = (np.zeros((1, COLOURS, 3, 3), np.float32),), np.zeros((1, ((size - 1) // 2 + 1) ** 2), np.float32)
    nothing = np.zeros(1, np.float32)
    return Eyes(kernels, (nothing,), (hidden, np.zeros((RAYS, 1), np.float32)), (nothing, np.zeros(RAYS, np.float32)))


def test_any_device_is_evaluated_with_the_driver_that_it_brings(folders, tmp_path, capsys):
    asked = ["evaluate", "own", "--device", "capsule", "--colon-folders", *folders, "--episodes", "1", "--seconds", "1"]
    assert main([*asked, "-o", str(tmp_path), "--threads", "1", "--json"]) == SUCCESS
    printed = json.loads(capsys.readouterr().out)["own"]
    assert printed["episodes"] == 2 and printed["outcomes"] == {"time_up": 2}
    assert [one["colon"] for one in json.loads((tmp_path / "episodes.json").read_text())["own"]] == list(BENDS)
    assert (tmp_path / "evaluation.png").stat().st_size > 1000
    assert main([*asked, "--blind"]) == BAD_INPUT
    assert "--blind" in capsys.readouterr().err
    assert main(["evaluate", "follower", *asked[2:]]) == BAD_INPUT
    assert "neither 'own' nor" in capsys.readouterr().err
