"""`haustra view` says what is missing."""

from pathlib import Path

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
