"""Reading files of strangers: bounded before they are read, and whatever is wrong with them said in one line."""

import json
import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np

from haustra.errors import MissingDependencyError, UnreadableFileError

LARGEST_DOCUMENT = 4_000_000
"""A configuration is at most this long [bytes]; a study that lists a hundred thousand designs is shorter."""
LARGEST_RECORD = 200_000_000
"""So is what haustra wrote as JSON itself, such as a colon's metadata or a policy's [bytes]."""
LARGEST_TRAJECTORY = 8_000_000_000
"""Joint positions of ten hours of a long scope [bytes]."""
LARGEST_ARRAYS = 400_000_000
"""Arrays of one archive, unpacked [bytes]: those of the largest surface that is taken, of four million triangles."""
_DEEPEST, _MOST_VALUES = 32, 2_000_000
"""Tables within tables, and values of a document in all, each alias of YAML counted with what it stands for."""
_BOM = "\ufeff"


def read_document(path: Path, what: str = "file", *, largest: int = LARGEST_DOCUMENT) -> Any:
    """A parsed TOML, JSON or YAML file, by its suffix.

    Args:
        path: the file.
        what: what it should be, for messages: 'design', 'study'.
        largest: how long it may be [bytes].

    Raises:
        UnreadableFileError: when it is missing, too long, not text, not of its kind, or tables nest too deeply.
        MissingDependencyError: for YAML without PyYAML.
    """
    kind, parse = _PARSERS.get(path.suffix.lower(), _PARSERS[".toml"])
    text = read_text(path, what, largest)
    try:
        document = parse(text)
    except RecursionError as error:
        raise UnreadableFileError(f"Cannot read the {what} '{path}': its tables nest too deeply.") from error
    except ValueError as error:
        reason = " ".join(str(error).split())[:200]
        raise UnreadableFileError(f"Cannot read the {what} '{path}': it is not {kind} ({reason}).") from error
    _require_bounded(document, f"Cannot read the {what} '{path}'")
    return document


def read_arrays(
    path: Path, names: Iterable[str], *, some: bool = False, largest: int = LARGEST_ARRAYS
) -> dict[str, Any]:
    """Arrays of an archive of numpy, whose sizes are read before any of them is unpacked; nothing in it is run.

    Args:
        path: the archive.
        names: which arrays.
        some: those of them that it holds, instead of all.
        largest: their size together, unpacked [bytes].

    Raises:
        UnreadableFileError: when it is missing, damaged, larger, or lacks an array.
    """
    try:
        with path.open("rb") as stream, ZipFile(stream) as archive:
            held = {entry.filename.removesuffix(".npy"): entry.file_size for entry in archive.infolist()}
            wanted = [name for name in names if name in held or not some]
            size = sum(held[name] for name in wanted)
            if size > largest:
                raise UnreadableFileError(f"'{path}' unpacks to {size / 1e6:.0f} MB, more than {largest / 1e6:g} MB.")
            for name in wanted:
                with archive.open(f"{name}.npy") as array:
                    _require_honest(array, held[name])
            stream.seek(0)
            with np.load(stream, allow_pickle=False) as arrays:
                return {name: arrays[name] for name in wanted}
    except OSError as error:
        raise UnreadableFileError(f"Cannot read '{path}': {error.strerror or error}.") from error
    except KeyError as error:
        raise UnreadableFileError(f"'{path}' holds no array {error}.") from error
    except UnreadableFileError:
        raise
    except Exception as error:  # numpy, zipfile, zlib and lzma each raise errors of many kinds for a damaged file
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        raise UnreadableFileError(f"'{path}' is damaged ({reason}).") from error


def read_text(path: Path, what: str, largest: int) -> str:
    """A text file in UTF-8.

    Args:
        path: the file.
        what: what it should be, for messages.
        largest: how long it may be [bytes].

    Raises:
        UnreadableFileError: when it is missing, too long or not text.
    """
    try:
        if not path.is_file():
            raise FileNotFoundError(None, "there is no such file")
        if path.stat().st_size > largest:
            raise UnreadableFileError(f"'{path}' is longer than {largest / 1e6:g} MB: that is no {what}.")
        return path.read_text(encoding="utf-8").removeprefix(_BOM)
    except UnicodeDecodeError as error:
        raise UnreadableFileError(f"Cannot read the {what} '{path}': it is not text in UTF-8.") from error
    except (OSError, ValueError) as error:  # a path with a null character is a ValueError
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise UnreadableFileError(f"Cannot read the {what} '{path}': {reason}.") from error


def _yaml(text: str) -> Any:
    try:
        import yaml
    except ImportError as error:
        raise MissingDependencyError("Files in YAML need PyYAML: 'pip install haustra[sweep]', or use TOML.") from error
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from error


_PARSERS: Mapping[str, tuple[str, Callable[[str], Any]]] = {
    ".toml": ("TOML", tomllib.loads),
    ".json": ("JSON", json.loads),
    ".yaml": ("YAML", _yaml),
    ".yml": ("YAML", _yaml),
}


def _require_bounded(document: Any, failed: str) -> None:
    """Walk through all values as they would be shown, and stop where that takes too long."""
    waiting, seen = [(document, 0)], 0
    while waiting:
        value, depth = waiting.pop()
        seen += 1
        if depth > _DEEPEST:
            raise UnreadableFileError(f"{failed}: its tables nest more than {_DEEPEST} deep.")
        if seen > _MOST_VALUES:
            raise UnreadableFileError(f"{failed}: it stands for more than {_MOST_VALUES} values.")
        inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
        waiting += [(one, depth + 1) for one in inner]


def _require_honest(stream: Any, size: int) -> None:
    """Refuse an array whose header asks for more memory than its file holds, or for objects."""
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, kind = read(stream)
    if kind.hasobject or min(shape, default=0) < 0 or math.prod(shape) * kind.itemsize > size:
        raise ValueError("an array is not what its header says")
