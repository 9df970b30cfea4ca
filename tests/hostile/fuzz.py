"""Files that nobody should have to read, made at random: `python tests/hostile/fuzz.py --meshes 20000 --maps 2000`.

Every file is read in a child process with limits. A child that dies of a signal, runs out of time, or shows a traceback
is a finding; a one-line error or a repaired surface is not. Files come from a seed: a finding can be made again.
"""

import argparse
import io
import json
import os
import struct
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

MEMORY = 6_000_000_000
"""Address space of a child [bytes]."""
SECONDS = 120
"""Time for a batch of files [s]: one takes milliseconds."""
BATCH = 100
"""Files to a child: starting Python anew for each would be most of the time."""


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


def spoil(content: bytes, rng: np.random.Generator) -> bytes:
    """Cut, flip, repeat or replace bytes."""
    kind, where = int(rng.integers(6)), int(rng.integers(len(content) + 1))
    if kind == 0:
        return content[:where]
    if kind == 1:
        spoiled = bytearray(content)
        for at in rng.integers(len(content), size=int(rng.integers(1, 30))) if content else ():
            spoiled[at] = int(rng.integers(256))
        return bytes(spoiled)
    if kind == 2:
        return content[:where] + rng.bytes(int(rng.integers(1, 200))) + content[where:]
    if kind == 3:
        return content[where:] + content[:where]
    if kind == 4:
        return rng.bytes(int(rng.integers(0, 3000)))
    return content[:200] + content[where:]


def label_file(rng: np.random.Generator) -> tuple[str, bytes]:
    """Suffix and content of a damaged label map, written without any library."""
    shape = tuple(int(n) for n in rng.integers(1, 24, size=3))
    kind = int(rng.integers(8))
    array = np.zeros(shape, np.uint8)
    if kind == 1:
        array[:] = rng.integers(0, 256, size=shape)
    elif kind == 2:
        array[:] = rng.random(shape) < 0.5
    elif kind == 3:
        array[: shape[0] // 3] = 1
        array[2 * shape[0] // 3 + 1 :] = 1
    elif kind >= 4:
        array[1:-1, 1:-1, 1:-1] = int(rng.integers(1, 4))
    sides = rng.choice(
        [0.7, 1.0, 5.0, 1000.0, 0.0, -1.0, float("nan")], p=[0.3, 0.3, 0.2, 0.05, 0.05, 0.05, 0.05], size=3
    )
    suffix = str(rng.choice(["nii", "nrrd", "mha"]))
    content = {"nii": _nifti, "nrrd": _nrrd, "mha": _mha}[suffix](array, sides)
    return suffix, spoil(content, rng) if rng.random() < 0.5 else content


def child(kind: str, seed: int, first: int, count: int, folder: Path) -> None:
    """Read files in this process and print what became of each; the parent waits with limits."""
    import resource
    import warnings

    from haustra.errors import HaustraError
    from haustra.models.anatomy.colon import Surface
    from haustra.models.anatomy.label_map import lumen_of_label, read_label_map
    from haustra.models.anatomy.mesh_file import read_pieces
    from haustra.models.anatomy.repair import is_watertight, repair

    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    _in_this_process()
    results: Counter[str] = Counter()
    for number in range(first, first + count):
        rng = np.random.Generator(np.random.PCG64([seed, number, kind == "maps"]))
        suffix, content = (label_file if kind == "maps" else mesh_file)(rng)
        file = folder / f"{number}.{suffix}"
        file.write_bytes(content)
        sys.stderr.write(f"at {number}\n")
        try:
            if kind == "maps":
                surface = lumen_of_label(read_label_map(file)).surface
            else:
                mesh = read_pieces([file])
                surface = repair(Surface(mesh.vertices * 1e-3, mesh.faces)).surface
            results["repaired" if is_watertight(surface.faces) else "open"] += 1
        except HaustraError as error:
            results["refused" if len(str(error).splitlines()) == 1 else "long message"] += 1
        file.unlink()
    print(json.dumps(results))


def _in_this_process() -> None:
    """Parse in the same process: here it is itself the child, and starting another for every file would take days."""
    from haustra.errors import UnreadableFileError
    from haustra.models.anatomy import label_map, label_parser, mesh_file, mesh_parser

    parsers = {"haustra.models.anatomy.mesh_parser": mesh_parser, "haustra.models.anatomy.label_parser": label_parser}
    for parser in parsers.values():
        setattr(parser, "limit_memory", lambda: None)  # noqa: B010 - a module has no such declared attribute

    def arrays_from(module: str, file: Path, kind: str, *arguments: str) -> dict[str, np.ndarray]:
        target = file.with_suffix(".npz")
        stderr, sys.stderr = sys.stderr, io.StringIO()
        try:
            code = parsers[module].main(str(file), str(target), *arguments)
        finally:
            sys.stderr = stderr
        if code:
            raise UnreadableFileError(f"'{file}' cannot be read as {kind}.")
        with np.load(target, allow_pickle=False) as arrays:
            found = {name: arrays[name] for name in arrays.files}
        target.unlink()
        return found

    mesh_file.arrays_from = arrays_from
    label_map.arrays_from = arrays_from


def fuzz(kind: str, count: int, *, seed: int = 0, first: int = 0) -> dict[str, int]:
    """Read `count` files of a kind ('meshes' or 'maps') and count what became of them.

    Keys: repaired, refused, open, long message, exception, crash, hang. A batch that ends badly is continued after the
    file that ended it.
    """
    total: Counter[str] = Counter()
    at, end = first, first + count
    while at < end:
        n = min(BATCH, end - at)
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, str(Path(__file__)), "--child", kind, str(seed), str(at), str(n), folder]
            try:
                done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
                stderr, code = done.stderr, done.returncode
            except subprocess.TimeoutExpired as expired:
                done, code = None, None
                stderr = expired.stderr.decode(errors="replace") if isinstance(expired.stderr, bytes) else ""
        if done is not None and code == 0:
            total.update(json.loads(done.stdout.splitlines()[-1]))
            at += n
            continue
        reached = [int(line[3:]) for line in stderr.splitlines() if line.startswith("at ")]
        worst = reached[-1] if reached else at
        what = "hang" if code is None else "crash" if code < 0 else "exception"
        reason = (stderr.strip().splitlines() or ["nothing was said"])[-1]
        sys.stderr.write(f"{what} at {kind} {worst} (seed {seed}): {reason[:200]}\n")
        total[what] += 1
        total["before a finding"] += worst - at
        at = worst + 1
    return dict(total)


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


def _nifti(array: np.ndarray, sides: np.ndarray) -> bytes:
    head = bytearray(352)
    struct.pack_into("<i", head, 0, 348)
    struct.pack_into("<8h", head, 40, 3, *array.shape, 1, 1, 1, 1)
    struct.pack_into("<hh", head, 70, 2, 8)
    struct.pack_into("<8f", head, 76, 1.0, *sides, 1, 1, 1, 1)
    struct.pack_into("<f", head, 108, 352.0)
    head[344:348] = b"n+1\0"
    return bytes(head) + array.tobytes(order="F")


def _nrrd(array: np.ndarray, sides: np.ndarray) -> bytes:
    sizes, spacings = " ".join(map(str, array.shape)), " ".join(map(str, sides))
    head = f"NRRD0004\ntype: uint8\ndimension: 3\nsizes: {sizes}\nspacings: {spacings}\nencoding: raw\n\n"
    return head.encode() + array.tobytes(order="F")


def _mha(array: np.ndarray, sides: np.ndarray) -> bytes:
    size, spacing = " ".join(map(str, array.shape)), " ".join(map(str, sides))
    head = f"ObjectType = Image\nNDims = 3\nBinaryData = True\nDimSize = {size}\nElementSpacing = {spacing}\n"
    return (head + "ElementType = MET_UCHAR\nElementDataFile = LOCAL\n").encode() + array.tobytes(order="F")


def main() -> int:
    """Fuzz as many files as asked; the exit code is 1 when there was a finding."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--meshes", type=int, default=20_000)
    parser.add_argument("--maps", type=int, default=2_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--child", nargs=5, metavar=("KIND", "SEED", "FIRST", "COUNT", "FOLDER"))
    options = parser.parse_args()
    if options.child:
        kind, seed, first, count, folder = options.child
        child(kind, int(seed), int(first), int(count), Path(folder))
        return 0
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    found = {
        kind: fuzz(kind, getattr(options, kind), seed=options.seed, first=options.first) for kind in ("meshes", "maps")
    }
    print(json.dumps(found))
    bad = ("open", "long message", "exception", "crash", "hang")
    return int(any(counts.get(name) for counts in found.values() for name in bad))


if __name__ == "__main__":
    sys.exit(main())
