import base64
import zlib
from pathlib import Path

import numpy as np
import pytest
import trimesh

from haustra.errors import InvalidMeshError, UnreadableFileError
from haustra.models.anatomy.mesh_file import read_mesh, read_pieces


@pytest.fixture
def box() -> trimesh.Trimesh:
    return trimesh.creation.box(extents=(1, 2, 3))


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "glb"])
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


TRIANGLE_VTK = """# vtk DataFile Version 3.0
a strip of two triangles and a square
ASCII
DATASET POLYDATA
POINTS 6 float
0 0 0 1 0 0 0 1 0
1 1 0 0 0 1 1 0 1
POLYGONS 1 5
4 0 1 5 4
TRIANGLE_STRIPS 1 5
4 0 1 2 3
POINT_DATA 6
"""


def test_vtk_polygons_and_strips_become_triangles(tmp_path: Path):
    file = tmp_path / "two.vtk"
    file.write_text(TRIANGLE_VTK)
    surface = read_mesh(file)
    corners = surface.vertices[surface.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    np.testing.assert_allclose(normal, [[0, -1, 0], [0, -1, 0], [0, 0, 1], [0, 0, 1]])


@pytest.mark.parametrize("compressed", [False, True])
def test_vtk_xml_with_encoded_arrays(tmp_path: Path, box: trimesh.Trimesh, compressed: bool):
    def encoded(array: np.ndarray) -> str:
        raw = array.tobytes()
        if not compressed:
            return base64.b64encode(np.uint32(len(raw)).tobytes() + raw).decode()
        packed = zlib.compress(raw)
        head = np.array([1, len(raw), 0, len(packed)], dtype="<u4")
        return base64.b64encode(head.tobytes()).decode() + base64.b64encode(packed).decode()

    points, faces = encoded(box.vertices.astype("<f8")), encoded(box.faces.astype("<i8"))
    offsets = encoded(np.arange(3, 37, 3).astype("<i8"))
    compressor = 'compressor="vtkZLibDataCompressor"' if compressed else ""
    file = tmp_path / "box.vtp"
    file.write_text(
        '<VTKFile type="PolyData" byte_order="LittleEndian" header_type="UInt32" '
        f"{compressor}><PolyData><Piece>"
        f'<Points><DataArray type="Float64" format="binary">{points}</DataArray></Points>'
        f'<Polys><DataArray type="Int64" Name="connectivity" format="binary">{faces}</DataArray>'
        f'<DataArray type="Int64" Name="offsets" format="binary">{offsets}</DataArray></Polys>'
        "</Piece></PolyData></VTKFile>"
    )
    surface = read_mesh(file)
    assert trimesh.Trimesh(surface.vertices, surface.faces).volume == pytest.approx(6.0)


def test_pieces_are_one_surface(tmp_path: Path, box: trimesh.Trimesh):
    files = []
    for number, part in enumerate((slice(0, 5), slice(5, 12))):
        files.append(tmp_path / f"{number}.ply")
        trimesh.Trimesh(box.vertices, box.faces[part], process=False).export(files[-1])
    surface = read_pieces(files)
    assert trimesh.Trimesh(surface.vertices, surface.faces).volume == pytest.approx(6.0)


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
        ("box.glb", b"glTF" + bytes(40), "cannot be read as GLB"),
        ("box.glb", b"PK" + bytes(40), "not a GLB"),
        ("noise.vtk", b"solid noise", "not a VTK"),
        ("grid.vtk", b"# vtk DataFile Version 3.0\n\nASCII\nDATASET STRUCTURED_POINTS\n", "not a surface"),
        ("short.vtk", b"# vtk DataFile Version 3.0\n\nASCII\nDATASET POLYDATA\nPOINTS 9 float\n1 2", "truncated"),
        ("bomb.vtp", b"<?xml version='1.0'?><!DOCTYPE x [<!ENTITY a 'aaaa'>]><x>&a;</x>", "not a surface"),
    ],
)
def test_what_is_no_mesh_is_refused_in_one_line(tmp_path: Path, name: str, content: bytes, message: str):
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises((UnreadableFileError, InvalidMeshError), match=message) as caught:
        read_pieces([file])
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
