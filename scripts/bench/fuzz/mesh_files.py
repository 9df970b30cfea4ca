"""Damaged meshes in every format that is read."""

import json
import struct

import numpy as np

from haustra.scripts.bench.fuzz.spoiling import spoil


def box(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A small closed tube, now and then of another size."""
    rings, angles = int(rng.integers(3, 12)), int(rng.integers(3, 9))
    turn = 2 * np.pi * np.arange(angles) / angles
    ring = np.column_stack([np.cos(turn), np.sin(turn)]) * 20
    body = np.concatenate([np.column_stack([ring, np.full(angles, 40.0 * k)]) for k in range(rings)])
    vertices = np.concatenate([body, [[0, 0, -5.0], [0, 0, 40.0 * rings]]]) * 10.0 ** rng.choice([0, 0, 0, -3, 3])
    faces = []
    for k in range(rings - 1):
        for j in range(angles):
            a, b = k * angles + j, k * angles + (j + 1) % angles
            faces += [(a, b, b + angles), (a, b + angles, a + angles)]
    for j in range(angles):
        faces += [((j + 1) % angles, j, rings * angles)]
        top = (rings - 1) * angles
        faces += [(top + j, top + (j + 1) % angles, rings * angles + 1)]
    return vertices, np.array(faces)


def hurt(vertices: np.ndarray, faces: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """One of the ways in which meshes come out of programs."""
    vertices, faces = vertices.copy(), faces.copy()
    kind = int(rng.integers(13))
    some = rng.random(len(faces)) < 0.3
    if kind == 0:
        faces = faces[~some]
    elif kind == 1:
        faces[some] = faces[some][:, ::-1]
    elif kind == 2:
        faces = faces[:, ::-1]
    elif kind == 3:
        vertices[rng.integers(len(vertices)), rng.integers(3)] = rng.choice([np.nan, np.inf, -np.inf, 1e300, 1e38])
    elif kind == 4:
        vertices *= 0
    elif kind == 5:
        vertices[:, 2] *= 0
    elif kind == 6:
        faces = np.concatenate([faces, rng.integers(len(vertices), size=(20, 3))])
    elif kind == 7:
        faces = np.concatenate([faces, faces, faces[:5]])
    elif kind == 8:
        faces = rng.integers(len(vertices), size=(int(rng.integers(1, 200)), 3))
    elif kind == 9:
        vertices = rng.normal(size=vertices.shape) * 100
    elif kind == 10:
        vertices = vertices[rng.integers(len(vertices), size=len(vertices))]
    elif kind == 11:
        faces[rng.integers(len(faces)), rng.integers(3)] = rng.choice([-1, len(vertices), 2**31 - 1])
    return vertices, faces


def mesh_file(rng: np.random.Generator) -> tuple[str, bytes]:
    """Suffix and content of a damaged mesh file."""
    vertices, faces = hurt(*box(rng), rng)
    suffix = str(rng.choice(["stl", "obj", "ply", "vtk", "vtp", "glb"]))
    content = {"stl": _stl, "obj": _obj, "ply": _ply, "vtk": _vtk, "vtp": _vtp, "glb": _glb}[suffix](vertices, faces)
    return suffix, spoil(content, rng) if rng.random() < 0.5 else content


def _stl(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    faces = np.clip(faces, 0, len(vertices) - 1)
    record = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["corners"] = vertices[faces]
    return b"fuzz".ljust(80) + struct.pack("<I", len(faces)) + record.tobytes()


def _obj(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    return "\n".join(lines).encode()


def _ply(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
    )
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [f"{x} {y} {z}" for x, y, z in vertices] + [f"3 {a} {b} {c}" for a, b, c in faces]
    return (head + "\n".join(rows) + "\n").encode()


def _vtk(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    head = f"# vtk DataFile Version 3.0\nfuzz\nBINARY\nDATASET POLYDATA\nPOINTS {len(vertices)} float\n".encode()
    cells = np.column_stack([np.full(len(faces), 3), faces]).astype(">i4")
    middle = f"\nPOLYGONS {len(faces)} {4 * len(faces)}\n".encode()
    return head + vertices.astype(">f4").tobytes() + middle + cells.tobytes()


def _vtp(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    def array(name: str, kind: str, values: np.ndarray) -> str:
        return f'<DataArray Name="{name}" type="{kind}" format="ascii">{" ".join(map(str, values.ravel()))}</DataArray>'

    text = f"<VTKFile type='PolyData'><PolyData><Piece><Points>{array('p', 'Float32', vertices)}</Points><Polys>"
    text += array("connectivity", "Int64", faces) + array("offsets", "Int64", np.arange(3, 3 * len(faces) + 1, 3))
    return (text + "</Polys></Piece></PolyData></VTKFile>").encode()


def _glb(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    points, index = vertices.astype("<f4").tobytes(), faces.astype("<i8").astype("<u4").tobytes()
    description = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": faces.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(points)},
            {"buffer": 0, "byteOffset": len(points), "byteLength": len(index)},
        ],
        "buffers": [{"byteLength": len(points) + len(index)}],
    }
    text = json.dumps(description).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(points) + len(index), b"BIN\0") + points + index
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks
