"""A decomposition that is killed half way: nothing half-written, no child left, and the next run goes on from there."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from haustra.models.anatomy.store import load_colon, save_colon
from haustra.models.wall.pieces.build import build_wall
from haustra.models.wall.pieces.folder import wall_folder
from haustra.models.wall.pieces.store import load_wall, save_wall
from tests.models.wall.conftest import swept_colon

KEPT = 4
"""Blocks that are kept before the killing."""
PATIENCE = 60.0
"""Longest wait for anything here [s]."""


def until(true, what: str) -> None:
    began = time.monotonic()
    while not true():
        assert time.monotonic() - began < PATIENCE, f"waited in vain: {what}"
        time.sleep(0.01)


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="looks for children in /proc")
def test_a_killed_build_leaves_nothing_half_written_and_is_taken_up_again(tmp_path: Path, monkeypatch):
    monkeypatch.setenv("HAUSTRA_CACHE", str(tmp_path / "cache"))
    arc = np.arange(0.0, 0.1, 0.003)
    save_colon(swept_colon(np.column_stack([arc, 0 * arc, 0 * arc]), name="tube"), tmp_path / "colon")
    command = [sys.executable, "-m", "haustra.scripts.main", "wall", str(tmp_path / "colon")]
    build = subprocess.Popen(
        [*command, "--method", "prism", "--workers", "1", "--rays", "1000"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )

    def blocks() -> list[Path]:
        return list((tmp_path / "cache" / "blocks").rglob("*.npz"))

    until(lambda: len(blocks()) >= KEPT or build.poll() is not None, "blocks in the cache")
    children = [int(pid) for task in Path(f"/proc/{build.pid}/task").iterdir() for pid in _children(task)]
    build.send_signal(signal.SIGKILL)
    assert build.wait() == -signal.SIGKILL  # it had not finished
    assert children
    until(lambda: not any(_lives(pid) for pid in children), "the end of its children")

    kept = len(blocks())
    folder = wall_folder(tmp_path / "colon", "prism")
    assert not list(folder.glob("*"))  # no file of a wall that is not whole
    wall = build_wall(load_colon(tmp_path / "colon"), method="prism", workers=1, rays=1000)
    cached, whole = (int(str(wall.metadata[name])) for name in ("blocks_cached", "blocks"))
    assert KEPT <= kept <= cached < whole
    save_wall(wall, folder)
    assert len(load_wall(folder).pieces) == len(wall.pieces)


def _children(task: Path) -> list[str]:
    try:
        return (task / "children").read_text().split()
    except OSError:  # a thread that has ended meanwhile
        return []


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except OSError:
        return False
    state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    return state != "Z"
