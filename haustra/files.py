"""Writing results so that an interrupted run never leaves half a file."""

import json
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from haustra.errors import OutputError


def prepare_folder(folder: Path) -> Path:
    """Create `folder` with its parents, or say in one line why it cannot be written.

    Raises:
        OutputError: when the folder cannot be created or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"Cannot write to '{folder}': {error.strerror or error}. Name another folder.") from error
    return folder


def write_atomically(path: Path, write: Callable[[Path], object]) -> Path:
    """Let `write` fill a temporary file beside `path`, then move it there in one step.

    The temporary file keeps the suffix of `path`, since many writers choose their format by it.

    Raises:
        OutputError: when the file cannot be written; nothing is left behind.
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        write(temporary)
        temporary.replace(path)
    except OSError as error:
        raise OutputError(f"Cannot write '{path}': {error.strerror or error}.") from error
    finally:
        temporary.unlink(missing_ok=True)
    return path


@contextmanager
def replaced_together(folder: Path) -> Iterator[Path]:
    """A place for files that belong together: they move into `folder` once all are there, and none does before.

    Raises:
        OutputError: when the folder cannot be written to.
    """
    prepare_folder(folder)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".unfinished-") as place:
        yield Path(place)
        try:
            for file in sorted(Path(place).iterdir()):
                file.replace(folder / file.name)
        except OSError as error:
            raise OutputError(f"Cannot write to '{folder}': {error.strerror or error}.") from error


def write_json(path: Path, value: object) -> Path:
    """Write a JSON document atomically; NaN and infinity are refused, since JSON has neither."""
    text = json.dumps(value, indent=2, allow_nan=False)
    return write_atomically(path, lambda temporary: temporary.write_text(text + "\n", encoding="utf-8"))
