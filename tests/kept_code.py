"""Machine code that numba made of this checkout's sources, kept where the next checkout finds it.

Numba keeps it beside the sources, where a fresh checkout has none, and finds it again by what the sources hold; to make
all of it takes half a minute of each test process.
"""

import shutil
from functools import partial
from pathlib import Path

from haustra.files import write_atomically
from haustra.models.wall.cache import cache_folder

ROOT = Path(__file__).parents[1]
ROOMS = ("models", "envs")


def bring(checkout: Path = ROOT) -> None:
    """Put what was kept beside sources that have none."""
    if not any(_made(checkout)):
        _copy(_kept(), checkout)


def keep(checkout: Path = ROOT) -> None:
    """Keep what there is now."""
    _copy(checkout, _kept())


def _kept() -> Path:
    return cache_folder() / "tests"


def _made(tree: Path) -> list[Path]:
    """Code, and then what tells it: an index must not be there before what it names."""
    found = [path for room in ROOMS for path in (tree / room).rglob("__pycache__/*.nb[ci]")]
    return sorted(found, key=lambda path: path.suffix)


def _copy(tree: Path, other: Path) -> None:
    for path in _made(tree):
        place = other / path.relative_to(tree)
        place.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(place, partial(shutil.copyfile, path))
