"""The worked example of docs/how-to/own-device.md: its file is read and driven as it stands there."""

from pathlib import Path

from haustra.envs.runs.device_run import run_device
from haustra.models.device_scene import device_options
from haustra.models.devices.base import load_device
from tests.tube_colon import straight_tube

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "own-device.md"


def test_the_pages_file_is_a_device_that_drives(tmp_path):
    text = PAGE.read_text(encoding="utf-8").split("```toml\n")[1].split("```")[0]
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    device = load_device(path)
    assert device.name == "mine"
    run = run_device(device, straight_tube(0.2), device_options(device), seconds=1.0)
    gained = run.records["tip_arc"][-1] - run.records["tip_arc"][0]
    assert 0.02 < gained < 0.05  # half of 0.8 N over 10 N s/m
