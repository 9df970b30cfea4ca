"""`haustra view` says what is missing."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from haustra.errors import MissingDependencyError, UnreadableFileError
from haustra.scripts.view import View


def test_no_scene_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(UnreadableFileError, match=r"scene\.mjz"):
        View(tmp_path)()


@pytest.mark.skipif("sys.platform != 'linux'", reason="displays are named by variables on Linux only")
def test_no_display_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scene.xml").write_text("<mujoco/>", encoding="utf-8")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(MissingDependencyError, match="DISPLAY"):
        View(tmp_path)()


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list:
    """Collects what the viewer would have been given."""
    collected = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr("mujoco.viewer.launch", lambda model, data: collected.append((model, data)))
    return collected


def _scene() -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE)
    body.add_geom(size=[0.1, 0.1, 0.1])
    return spec


def _zip(path: Path) -> None:
    with path.open("wb") as file:
        _scene().to_zip(file)


@pytest.mark.parametrize("name", ["scene.xml", "scene.mjz"])
def test_a_run_is_shown_at_its_end(tmp_path: Path, shown: list, name: str) -> None:
    if name.endswith(".mjz"):
        _zip(tmp_path / name)
    else:
        spec = _scene()
        spec.compile()
        (tmp_path / name).write_text(spec.to_xml(), encoding="utf-8")
    np.savez(tmp_path / "trajectory.npz", qpos=np.array([[0.1], [0.7]]))
    View(tmp_path)()
    ((_, data),) = shown
    assert data.qpos == pytest.approx([0.7])


def test_a_trajectory_of_another_scene_is_refused(tmp_path: Path, shown: list) -> None:
    _zip(tmp_path / "scene.mjz")
    np.savez(tmp_path / "trajectory.npz", qpos=np.zeros((3, 5)))
    with pytest.raises(UnreadableFileError, match="another scene"):
        View(tmp_path)()
    assert not shown


@pytest.mark.parametrize("name", ["scene.xml", "scene.mjz"])
@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut", b"<mujoco><worldbody>"])
def test_a_broken_scene_is_one_line(tmp_path: Path, shown: list, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UnreadableFileError) as caught:
        View(tmp_path)()
    assert "\n" not in str(caught.value)
    assert not shown
