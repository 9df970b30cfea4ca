"""Results kept between runs, by content hash: decomposed blocks and whole walls."""

import os
from pathlib import Path

from haustra.errors import OutputError
from haustra.files import write_atomically


def cache_folder() -> Path:
    """`HAUSTRA_CACHE`, or haustra's folder in the user's cache (XDG base directory specification)."""
    named = os.environ.get("HAUSTRA_CACHE")
    if named:
        return Path(named)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "haustra"


def block_path(key: str) -> Path:
    """Where the hulls of a block are kept."""
    return cache_folder() / "blocks" / key[:2] / f"{key}.npz"


def wall_path(key: str) -> Path:
    """Where a whole wall is kept."""
    return cache_folder() / "walls" / key


def read(path: Path) -> bytes | None:
    """What is kept there, or None."""
    try:
        return path.read_bytes()
    except OSError:
        return None


def keep(path: Path, data: bytes) -> None:
    """Keep bytes; a cache that cannot be written is no reason to fail."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, lambda temporary: temporary.write_bytes(data))
    except (OSError, OutputError):
        return
