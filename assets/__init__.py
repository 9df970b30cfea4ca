"""Data that ships. Code here only finds files."""

from pathlib import Path


def asset(name: str) -> Path:
    """Path of a shipped file, given relative to this folder with forward slashes.

    Raises:
        FileNotFoundError: when there is no such file.
    """
    path = Path(__file__).parent.joinpath(*name.split("/"))
    if not path.is_file():
        raise FileNotFoundError(f"No shipped file '{name}' in {path.parent}: reinstall haustra.")
    return path


def assets(folder: str, suffix: str) -> dict[str, Path]:
    """Shipped files of one folder by their stems, in order."""
    return {path.stem: path for path in sorted((Path(__file__).parent / folder).glob(f"*{suffix}"))}
