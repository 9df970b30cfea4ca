import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from tube_colon import straight_tube

from haustra.errors import OutputError, UnreadableFileError
from haustra.models.anatomy.store import colon_hash, load_colon, save_colon


def test_what_is_saved_is_read(tmp_path: Path):
    colon = replace(straight_tube(), landmarks={"anus": 0.0}, warnings=("one", "two"))
    again = load_colon(save_colon(colon, tmp_path / "new" / "colon"))
    assert colon_hash(again) == colon_hash(colon)
    np.testing.assert_array_equal(again.lumen.vertices, colon.lumen.vertices)
    np.testing.assert_array_equal(again.centreline.frames, colon.centreline.frames)
    assert again.segments == colon.segments
    assert again.provenance == colon.provenance
    assert (again.name, again.landmarks, again.warnings) == (colon.name, colon.landmarks, colon.warnings)


def test_other_programs_get_the_surface_in_mm(tmp_path: Path):
    save_colon(straight_tube(0.6), tmp_path)
    mesh = trimesh.load_mesh(tmp_path / "lumen.stl")
    assert mesh.is_watertight
    assert mesh.extents[2] == pytest.approx(600.0)


def test_hash_is_of_the_geometry_alone():
    colon = straight_tube()
    assert colon_hash(replace(colon, name="other", warnings=("noted",))) == colon_hash(colon)
    assert colon_hash(replace(colon, radius=colon.radius * 1.001)) != colon_hash(colon)


def test_folder_without_a_colon(tmp_path: Path):
    with pytest.raises(UnreadableFileError, match=r"colon\.json is missing"):
        load_colon(tmp_path / "nowhere")


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("colon.json", lambda text: text[: len(text) // 2], "it is not JSON"),
        ("colon.json", lambda text: b"[]", "does not describe"),
        ("colon.json", lambda text: text.replace(b'"format_version": 1', b'"format_version": 99'), "version 99"),
        ("colon.json", lambda text: text.replace(b'"segments"', b'"parts"'), "incomplete"),
        ("colon.npz", lambda text: text[: len(text) // 2], "is damaged"),
        ("colon.npz", lambda text: b"", "is damaged"),
    ],
)
def test_damaged_files_end_in_one_line(tmp_path: Path, name: str, change, message: str):
    save_colon(straight_tube(), tmp_path)
    (tmp_path / name).write_bytes(change((tmp_path / name).read_bytes()))
    with pytest.raises(UnreadableFileError, match=message) as caught:
        load_colon(tmp_path)
    assert "\n" not in str(caught.value)


def test_files_of_two_colons_are_told_apart(tmp_path: Path):
    save_colon(straight_tube(0.6), tmp_path / "a")
    save_colon(straight_tube(0.5), tmp_path / "b")
    (tmp_path / "a" / "colon.npz").replace(tmp_path / "b" / "colon.npz")
    with pytest.raises(UnreadableFileError, match="belong together"):
        load_colon(tmp_path / "b")


def test_pickled_arrays_are_not_opened(tmp_path: Path):
    save_colon(straight_tube(), tmp_path)
    with np.load(tmp_path / "colon.npz") as stored:
        arrays = {name: stored[name] for name in stored} | {"arc": np.array([{"a": 1}], dtype=object)}
    np.savez(tmp_path / "colon.npz", allow_pickle=True, **arrays)
    with pytest.raises(UnreadableFileError, match="is damaged"):
        load_colon(tmp_path)


def test_unwritable_place(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="Cannot write"):
        save_colon(straight_tube(), tmp_path / "file" / "colon")


def test_metadata_is_plain_json_in_si(tmp_path: Path):
    save_colon(straight_tube(0.6), tmp_path)
    metadata = json.loads((tmp_path / "colon.json").read_text())
    assert metadata["segments"][-1] == {"name": "sigmoid", "start": 0.3, "end": 0.6}
