from pathlib import Path

import numpy as np
import pytest
import trimesh

from haustra.errors import InvalidMeshError, UnreadableFileError
from haustra.models.anatomy.mesh_file import read_mesh


@pytest.fixture
def box() -> trimesh.Trimesh:
    return trimesh.creation.box(extents=(1, 2, 3))


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply"])
def test_every_format_gives_the_same_solid(tmp_path: Path, box: trimesh.Trimesh, suffix: str):
    file = tmp_path / f"box.{suffix}"
    box.export(file)
    surface = read_mesh(file)
    assert trimesh.Trimesh(surface.vertices, surface.faces).volume == pytest.approx(6.0)


def stl(mesh: trimesh.Trimesh) -> bytes:
    content = mesh.export(file_type="stl")
    assert isinstance(content, bytes)
    return content


def test_ascii_stl_is_read_and_its_end_is_missed(tmp_path: Path, box: trimesh.Trimesh):
    file = tmp_path / "box.stl"
    text = str(box.export(file_type="stl_ascii"))
    file.write_text(text)
    assert len(read_mesh(file).faces) == 12
    file.write_text(text[: len(text) // 2])
    with pytest.raises(UnreadableFileError, match="truncated"):
        read_mesh(file)


def test_truncated_binary_stl(tmp_path: Path, box: trimesh.Trimesh):
    file = tmp_path / "box.stl"
    file.write_bytes(stl(box)[:-70])
    with pytest.raises(UnreadableFileError, match="truncated: it holds 10 of 12"):
        read_mesh(file)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("empty.stl", b"", "empty"),
        ("noise.stl", b"\x93" * 5000, "not an STL|truncated"),
        ("text.stl", b"dear colon, " * 50, "not an STL|truncated"),
        ("text.ply", b"no polygons", "not a PLY"),
        ("head.ply", b"ply\nformat ascii 1.0\nelement vertex 9\n", "cannot be read as PLY"),
        ("points.obj", b"v 0 0 0\nv 1 0 0\n", "cannot be read as OBJ|no triangles"),
        ("scan.dcm", b"DICM", "not a mesh by its name"),
    ],
)
def test_what_is_no_mesh_is_refused_in_one_line(tmp_path: Path, name: str, content: bytes, message: str):
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises((UnreadableFileError, InvalidMeshError), match=message) as caught:
        read_mesh(file)
    assert "\n" not in str(caught.value)


def test_missing_file_and_folder(tmp_path: Path):
    with pytest.raises(UnreadableFileError, match="No such file"):
        read_mesh(tmp_path / "none.stl")
    with pytest.raises(UnreadableFileError, match="folder"):
        read_mesh(tmp_path)


def test_coordinates_that_are_no_numbers(tmp_path: Path, box: trimesh.Trimesh):
    content = bytearray(stl(box))
    content[96:100] = np.float32(np.nan).tobytes()
    file = tmp_path / "nan.stl"
    file.write_bytes(bytes(content))
    with pytest.raises(InvalidMeshError, match="finite"):
        read_mesh(file)
