"""Parse one mesh file and write its arrays: run as a child process, so that no file can take the parent down."""

import sys
from pathlib import Path

from haustra.models.anatomy.child import complain, limit_memory


def main(source: str, target: str) -> int:
    """Read `source` and write vertices and faces to `target` (npz); 1 and a reason when it cannot."""
    limit_memory()
    import numpy as np

    try:
        vertices, faces = _read(Path(source))
        vertices, faces = vertices.reshape(-1, 3), faces.reshape(-1, 3)
    except (Exception, RecursionError) as error:  # whatever the parser stumbles over is a fault of the file
        return complain(error)
    np.savez(Path(target), vertices=vertices, faces=faces)
    return 0


def _read(file: Path):
    """Vertices and triangles of a file, by its suffix and, for VTK, by what it begins with."""
    if file.suffix.lower() in (".vtk", ".vtp", ".vtu"):
        from haustra.models.anatomy.vtk_legacy import read_vtk_legacy
        from haustra.models.anatomy.vtk_xml import read_vtk_xml

        with file.open("rb") as stream:
            legacy = stream.read(64).startswith(b"# vtk")
        return read_vtk_legacy(file) if legacy else read_vtk_xml(file)
    import numpy as np

    if file.suffix.lower() in (".xyz", ".csv"):
        lines = file.read_text(encoding="utf-8").replace(",", " ").replace(";", " ").splitlines()
        if lines and not _is_numbers(lines[0]):
            lines = lines[1:]  # names of the columns
        table = np.loadtxt(lines, dtype=float, ndmin=2)
        return table[:, :3], np.empty((0, 3), np.int64)
    import trimesh

    mesh = trimesh.load_mesh(file, process=False)
    vertices = np.asarray(getattr(mesh, "vertices", np.empty((0, 3))), dtype=np.float64)
    return vertices, np.asarray(getattr(mesh, "faces", np.empty((0, 3))), dtype=np.int64)


def _is_numbers(line: str) -> bool:
    try:
        list(map(float, line.split()))
    except ValueError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
