"""Reading damaged files in child processes with limits.

A child that dies of a signal, runs out of time, or shows a traceback is a finding; a one-line error, a repaired surface
or a file that is taken is not. Files come from a seed: a finding can be made again.
"""

import io
import json
import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from haustra.errors import HaustraError, UnreadableFileError

KINDS = ("meshes", "maps", "documents")
"""Surface meshes, label maps, and configurations in TOML and JSON."""
FINDINGS = ("open", "long message", "exception", "crash", "hang")
"""Results that should not be."""
MEMORY = 6_000_000_000
"""Address space of a child [bytes]."""
SECONDS = 240
"""Time for a batch of files [s]: one takes milliseconds."""
BATCH = 100
"""Files to a child: starting Python anew for each would be most of the time."""
LONGEST_MESSAGE = 2000
"""Characters of a message that is still one line."""


def fuzz(
    kind: str, count: int, *, seed: int = 0, first: int = 0, tell: Callable[[int], None] = lambda done: None
) -> dict[str, int]:
    """Read `count` files of a kind (`KINDS`) and count what became of them.

    Keys: repaired, taken, refused, and `FINDINGS`. A batch that ends badly is continued after the
    file that ended it.
    """
    total: Counter[str] = Counter()
    at, end = first, first + count
    while at < end:
        n = min(BATCH, end - at)
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-m", "haustra.scripts.bench.fuzz.run", kind, str(seed), str(at), str(n), folder]
            try:
                done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
                stderr, code = done.stderr, done.returncode
            except subprocess.TimeoutExpired as expired:
                done, code = None, None
                stderr = expired.stderr.decode(errors="replace") if isinstance(expired.stderr, bytes) else ""
        if done is not None and code == 0:
            total.update(json.loads(done.stdout.splitlines()[-1]))
            at += n
            tell(at - first)
            continue
        reached = [int(line[3:]) for line in stderr.splitlines() if line.startswith("at ")]
        worst = reached[-1] if reached else at
        what = "hang" if code is None else "crash" if code < 0 else "exception"
        reason = (stderr.strip().splitlines() or ["nothing was said"])[-1]
        sys.stderr.write(f"{what} at {kind} {worst} (seed {seed}): {reason[:200]}\n")
        total[what] += 1
        total["before a finding"] += worst - at
        at = worst + 1
        tell(at - first)
    return dict(total)


def child(kind: str, seed: int, first: int, count: int, folder: Path) -> None:
    """Read files in this process and print what became of each; the parent waits with limits."""
    import resource

    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    read = {"meshes": _read_mesh, "maps": _read_map, "documents": _read_document}[kind]
    _in_this_process()
    results: Counter[str] = Counter()
    for number in range(first, first + count):
        rng = np.random.Generator(np.random.PCG64([seed, number, KINDS.index(kind)]))
        sys.stderr.write(f"at {number}\n")
        try:
            results[read(folder, number, rng)] += 1
        except HaustraError as error:
            fine = str(error).isprintable() and len(str(error)) <= LONGEST_MESSAGE
            results["refused" if fine else "long message"] += 1
    sys.stdout.write(json.dumps(results) + "\n")


def _read_mesh(folder: Path, number: int, rng: np.random.Generator) -> str:
    from haustra.models.anatomy.colon import Surface
    from haustra.models.anatomy.mesh_file import read_pieces
    from haustra.models.anatomy.repair import is_watertight, repair
    from haustra.scripts.bench.fuzz.mesh_files import mesh_file

    suffix, content = mesh_file(rng)
    with _file(folder / f"{number}.{suffix}", content) as file:
        mesh = read_pieces([file])
        surface = repair(Surface(mesh.vertices * 1e-3, mesh.faces)).surface
    return "repaired" if is_watertight(surface.faces) else "open"


def _read_map(folder: Path, number: int, rng: np.random.Generator) -> str:
    from haustra.models.anatomy.label_map import lumen_of_label, read_label_map
    from haustra.models.anatomy.repair import is_watertight
    from haustra.scripts.bench.fuzz.label_files import label_file

    suffix, content = label_file(rng)
    with _file(folder / f"{number}.{suffix}", content) as file:
        surface = lumen_of_label(read_label_map(file)).surface
    return "repaired" if is_watertight(surface.faces) else "open"


def _read_document(folder: Path, number: int, rng: np.random.Generator) -> str:
    from haustra.scripts.bench.fuzz.documents import document, read

    kind, suffix, content = document(rng)
    with _file(folder / f"{number}.{suffix}", content) as file:
        read(kind, file)
    return "taken"


@contextmanager
def _file(path: Path, content: bytes) -> Iterator[Path]:
    path.write_bytes(content)
    try:
        yield path
    finally:
        path.unlink()


def _in_this_process() -> None:
    """Parse in the same process: here it is itself the child, and starting another for every file would take days."""
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


if __name__ == "__main__":
    kind, seed, first, count, folder = sys.argv[1:]
    child(kind, int(seed), int(first), int(count), Path(folder))
