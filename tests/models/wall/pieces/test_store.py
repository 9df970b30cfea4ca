"""A wall comes back from its folder as it was; a damaged one is refused in one line."""

import json

import numpy as np
import pytest

from haustra.errors import UnreadableFileError
from haustra.models.wall.pieces.store import ARRAYS, METADATA, load_wall, save_wall
from haustra.models.wall.pieces.wall import Wall, WallAccuracy, WallPiece
from haustra.provenance import Provenance


@pytest.fixture
def wall() -> Wall:
    rng = np.random.default_rng(0)
    pieces = tuple(WallPiece(rng.normal(size=(count, 3)), 0.02 * count, 0.02 * count + 0.02) for count in (8, 5, 12))
    error = WallAccuracy(1.0, 0.5, 0.25, 0.3, -0.1, 0.2, 1000, 0)
    return Wall("prism", pieces, error, Provenance({"tube": "0"}, {"tolerance": 0.001}), {"thickness_m": 0.03})


def test_round_trip(wall, tmp_path):
    again = load_wall(save_wall(wall, tmp_path / "wall"))
    assert again.error == wall.error
    assert again.provenance == wall.provenance
    assert again.metadata == wall.metadata
    for before, after in zip(wall.pieces, again.pieces, strict=True):
        np.testing.assert_array_equal(before.vertices, after.vertices)
        assert (before.start, before.end) == (after.start, after.end)


def test_a_missing_wall_says_how_to_get_one(tmp_path):
    with pytest.raises(UnreadableFileError, match="haustra wall"):
        load_wall(tmp_path)


@pytest.mark.parametrize("name", [METADATA, ARRAYS])
def test_a_truncated_wall_is_refused(wall, tmp_path, name):
    folder = save_wall(wall, tmp_path)
    data = (folder / name).read_bytes()
    (folder / name).write_bytes(data[: len(data) // 2])
    with pytest.raises(UnreadableFileError):
        load_wall(folder)


def test_another_format_is_refused(wall, tmp_path):
    folder = save_wall(wall, tmp_path)
    known = json.loads((folder / METADATA).read_text())
    (folder / METADATA).write_text(json.dumps({**known, "format_version": 99}))
    with pytest.raises(UnreadableFileError, match="build the wall again"):
        load_wall(folder)
