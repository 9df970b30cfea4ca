"""Running a parser in a child process with limits, so that no file can crash, hang or fill the parent."""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from haustra.errors import UnreadableFileError

MEMORY_LIMIT = 8_000_000_000
"""Address space of the child [bytes], where the system can limit it."""
PARSE_SECONDS = 120
"""A parser that takes longer hangs: five million triangles load in 20 s."""
LONGEST_REASON = 160
"""Characters of a parser's complaint that are passed on."""


def arrays_from(module: str, file: Path, kind: str, *arguments: str) -> dict[str, np.ndarray]:
    """Let `python -m module FILE TARGET arguments...` write arrays to TARGET (npz) and return them.

    Args:
        module: A module whose command line this is; it exits with 1 and a reason on stderr when it cannot.
        file: What it reads.
        kind: What the file should be, for the message.
        arguments: Passed on.

    Raises:
        UnreadableFileError: when the child fails, crashes, or takes too long.
    """
    with tempfile.TemporaryDirectory() as scratch:
        target = Path(scratch) / "arrays.npz"
        command = [sys.executable, "-m", module, str(file.resolve()), str(target), *arguments]
        try:
            child = subprocess.run(command, capture_output=True, text=True, timeout=PARSE_SECONDS, check=False)
        except subprocess.TimeoutExpired as error:
            raise UnreadableFileError(
                f"'{file}' took more than {PARSE_SECONDS} s to read: simplify it, or convert it to a binary format."
            ) from error
        if child.returncode != 0 or not target.is_file():
            reason = (child.stderr.strip().splitlines() or ["the parser crashed"])[-1][:LONGEST_REASON]
            raise UnreadableFileError(f"'{file}' cannot be read as {kind} ({reason}): export it again.")
        with np.load(target, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}


def limit_memory() -> None:
    """Called first in the child: a file that unpacks to more than `MEMORY_LIMIT` fails there."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    except (ImportError, OSError, ValueError):
        return  # not every system can limit it; the time limit of the parent still holds


def complain(error: BaseException) -> int:
    """Say in one line why a file cannot be read; the child's exit code."""
    reason = " ".join(str(error).split())
    sys.stderr.write(f"{type(error).__name__}: {reason}\n" if reason else f"{type(error).__name__}\n")
    return 1
