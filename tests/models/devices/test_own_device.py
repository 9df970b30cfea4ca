"""The worked examples of docs/how-to/own-device.md: its file and its class are taken and driven as they stand there."""

import importlib.util
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from haustra.envs.runs.device_run import run_device
from haustra.models.device_scene import device_options
from haustra.models.devices import base
from haustra.models.devices.base import Device, load_device
from tests.tube_colon import straight_tube

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "own-device.md"


def blocks(kind: str) -> list[str]:
    return re.findall(rf"```{kind}\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


def test_the_pages_file_is_a_device_that_drives(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(blocks("toml")[0], encoding="utf-8")
    device = load_device(path)
    assert device.name == "mine"
    run = run_device(device, straight_tube(0.2), device_options(device), seconds=1.0)
    gained = run.records["tip_arc"][-1] - run.records["tip_arc"][0]
    assert 0.02 < gained < 0.05  # half of 0.8 N over 10 N s/m


@pytest.fixture
def thruster(tmp_path, monkeypatch) -> Device:
    """The page's class as a kind with a folder: a TOML file names it."""
    name = "haustra.models.devices.thruster.interface"
    (tmp_path / "interface.py").write_text(blocks("python")[0], encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, tmp_path / "interface.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, name, module)
    spec.loader.exec_module(module)
    known = base.kinds()
    monkeypatch.setattr(base, "kinds", lambda: (*known, "thruster"))
    numbers = re.search(r"ball = Thruster\((.*)\)", blocks("python")[1])
    assert numbers
    (tmp_path / "ball.toml").write_text('kind = "thruster"\n' + numbers[1].replace(", ", "\n"), encoding="utf-8")
    return load_device(tmp_path / "ball.toml")


def test_the_pages_class_is_a_kind_that_drives(thruster):
    """Half of the jet over the drag, 50 mm/s."""
    run = run_device(thruster, straight_tube(0.2), device_options(thruster, mesentery=True), seconds=1.0)
    assert run.records["tip_arc"][-1] - run.records["tip_arc"][0] == pytest.approx(0.05, rel=0.03)  # from rest
    assert run.records["thrust"][-1] == pytest.approx(0.5) and thruster.kind == "thruster"


def test_the_pages_class_is_an_environment(thruster):
    pytest.importorskip("gymnasium")
    from gymnasium.utils.env_checker import check_env

    from haustra.envs.tasks.device_env import DeviceEnv

    made = DeviceEnv(thruster, colons=[straight_tube(0.2)])
    check_env(made, skip_render_check=True)
    made.reset(seed=0)
    _, reward, *_ = made.step(np.array([0, 0, 1], np.float32))
    assert reward > 0
