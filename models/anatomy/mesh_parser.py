"""Parse one mesh file and write its arrays: run as a child process, so that no file can take the parent down."""

import sys
from pathlib import Path

MEMORY_LIMIT = 8_000_000_000
"""Address space of the child [bytes], where the system can limit it."""


def main(source: str, target: str) -> int:
    """Read `source` with trimesh and write vertices and faces to `target` (npz); 1 and a reason when it cannot."""
    _limit_memory()
    import numpy as np
    import trimesh

    try:
        mesh = trimesh.load_mesh(source, process=False)
    except Exception as error:  # whatever the parser stumbles over is a fault of the file
        sys.stderr.write(f"{type(error).__name__}: {' '.join(str(error).split())}\n")
        return 1
    vertices = np.asarray(getattr(mesh, "vertices", np.empty((0, 3))), dtype=np.float64)
    faces = np.asarray(getattr(mesh, "faces", np.empty((0, 3))), dtype=np.int64)
    np.savez(Path(target), vertices=vertices.reshape(-1, 3), faces=faces.reshape(-1, 3))
    return 0


def _limit_memory() -> None:
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    except (ImportError, OSError, ValueError):
        return  # not every system can limit it; the time limit of the parent still holds


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
