"""Files that nobody should have to read end in one line or in a repair that is reported."""

import gzip
import json
import sys
import time
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from bent_tube import bent_tube, hairpin

from haustra.errors import HaustraError, InvalidMeshError, InvalidOptionError, OutputError, UnreadableFileError
from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.label_colon import import_label_map
from haustra.models.anatomy.mesh_colon import import_colon
from haustra.models.anatomy.mesh_file import read_mesh
from haustra.models.anatomy.repair import is_watertight, repair
from haustra.models.anatomy.store import save_colon
from haustra.scripts.bench.fuzz.run import fuzz
from haustra.scripts.main import BAD_INPUT, main
from tests.models.anatomy.conftest import short_ones_allowed

sitk = pytest.importorskip("SimpleITK")


@pytest.fixture(scope="module")
def tube() -> Surface:
    return bent_tube(hairpin(0.45, 0.05), 0.02, step=0.01, angles=16)


def stl(surface: Surface, scale: float = 1e3) -> bytes:
    content = trimesh.Trimesh(surface.vertices * scale, surface.faces, process=False).export(file_type="stl")
    assert isinstance(content, bytes)
    return content


def test_mesh_open_at_one_side_is_refused(tmp_path: Path, tube: Surface):
    half = Surface(tube.vertices, tube.faces[tube.vertices[tube.faces].mean(1)[:, 1] > 0])
    file = tmp_path / "open.stl"
    file.write_bytes(stl(half))
    with pytest.raises(InvalidMeshError, match="part of the wall is missing"):
        import_colon(file, units="mm")


def test_self_intersecting_mesh_is_one_line_or_a_closed_surface(tube: Surface):
    crossing = Surface(tube.vertices * [0.3, 1.0, 1.0], tube.faces)  # the legs run through each other
    assert is_watertight(repair(crossing).surface.faces)


def test_wrong_unit_is_named(tmp_path: Path, tube: Surface):
    file = tmp_path / "metres.stl"
    file.write_bytes(stl(tube, 1.0))
    with short_ones_allowed(), pytest.raises(InvalidMeshError, match="probably in m"):
        import_colon(file, units="mm")


def test_ten_million_triangles_are_refused_before_they_are_read(tmp_path: Path):
    """A whole file of that size, all zeros: half a gigabyte that takes no room on the disk."""
    count = 10_000_000
    file = tmp_path / "huge.stl"
    with file.open("wb") as stream:
        stream.write(b"\0" * 80 + count.to_bytes(4, "little"))
        stream.truncate(84 + 50 * count)
    began = time.process_time()
    with pytest.raises(UnreadableFileError, match="10000000 triangles, more than 4000000: simplify it"):
        import_colon(file, units="mm")
    assert time.process_time() - began < 1


def test_compressed_bomb_in_a_vtk_file_stays_in_the_child(tmp_path: Path):
    zeros = zlib.compress(bytes(50_000_000), 9)
    head = np.array([200, 2**31, 0, *[len(zeros)] * 200], dtype="<u4").tobytes()
    body = b"_" + head + zeros * 200
    file = tmp_path / "bomb.vtp"
    file.write_bytes(
        b'<VTKFile type="PolyData" compressor="vtkZLibDataCompressor" header_type="UInt32"><PolyData><Piece><Points>'
        b'<DataArray type="Float32" format="appended" offset="0"/></Points></Piece></PolyData>'
        b'<AppendedData encoding="raw">' + body + b"</AppendedData></VTKFile>"
    )
    with pytest.raises(UnreadableFileError, match="too large"):
        read_mesh(file)


def test_zip_that_is_called_a_mesh(tmp_path: Path):
    file = tmp_path / "bomb.stl"
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("zeros", bytes(10_000_000))
    with pytest.raises(UnreadableFileError, match="not an STL"):
        read_mesh(file)


def test_file_that_may_not_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    file = tmp_path / "secret.stl"
    file.write_bytes(b"x")

    def denied(*_args, **_options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", denied)  # root may read everything
    with pytest.raises(UnreadableFileError, match="Permission denied"):
        read_mesh(file)


def write_labels(folder: Path, array: np.ndarray, name: str = "labels.nii.gz", spacing: float = 1.0) -> Path:
    image = sitk.GetImageFromArray(array.astype(np.uint8))
    image.SetSpacing((spacing,) * 3)
    sitk.WriteImage(image, str(folder / name), True)
    return folder / name


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda array: array * 0, "shows no colon"),
        (lambda array: array * np.array([1, 0, 0, 0, 2] * 4, np.uint8)[:, None, None], "2 labels"),
        (lambda array: array * np.array([1, 1, 0, 1, 1] * 4, np.uint8)[:, None, None], "separate bodies"),
    ],
)
def test_labels_with_no_colon_or_two(tmp_path: Path, make: Callable, message: str):
    array = np.zeros((20, 20, 20), np.uint8)
    array[:, 2:-2, 2:-2] = 1
    with pytest.raises(HaustraError, match=message) as caught:
        import_label_map(write_labels(tmp_path, make(array)))
    assert "\n" not in str(caught.value)


def test_label_that_is_not_there_and_voxels_that_are_too_large(tmp_path: Path):
    array = np.ones((8, 8, 8), np.uint8)
    with pytest.raises(InvalidOptionError, match="no label 7"):
        import_label_map(write_labels(tmp_path, array), label=7)
    with pytest.raises(InvalidMeshError, match="size in mm"):
        import_label_map(write_labels(tmp_path, array, spacing=1000.0))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("empty.nii", b""),
        ("noise.nrrd", b"\x81" * 500),
        ("short.nii.gz", gzip.compress(b"x" * 100, mtime=0)[:-9]),
        ("mesh.mha", b"solid mesh\nendsolid"),
        ("away.mhd", b"ObjectType = Image\nNDims = 3\nDimSize = 9 9 9\nElementDataFile = ../../../etc/passwd\n"),
    ],
)
def test_what_is_no_label_map(tmp_path: Path, name: str, content: bytes):
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(UnreadableFileError) as caught:
        import_label_map(file)
    assert "\n" not in str(caught.value)


def test_full_disk_leaves_no_half_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from tube_colon import straight_tube

    def full(*_args, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    with pytest.raises(OutputError, match="No space left"):
        save_colon(straight_tube(), tmp_path / "colon")
    assert not list((tmp_path / "colon").iterdir())


def test_import_of_nothing_is_one_line_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    arguments = ["colon", "import", str(tmp_path / "none.nii.gz"), "-o", str(tmp_path / "out"), "--json"]
    assert main(arguments) == BAD_INPUT
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len([line for line in captured.err.splitlines() if line.startswith("haustra:")]) == 1


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="limits of child processes are POSIX")
@pytest.mark.thorough
def test_seven_hundred_fuzzed_files_crash_and_hang_nothing():
    found = {"meshes": fuzz("meshes", 400), "maps": fuzz("maps", 100), "documents": fuzz("documents", 200)}
    for counts in found.values():
        assert set(counts) <= {"repaired", "taken", "refused"}, json.dumps(found)
        assert counts["refused"] and counts.get("repaired", counts.get("taken"))
