"""Machine code that numba and JAX made of this checkout's sources, kept where the next checkout finds it.

Numba keeps it beside the sources, where a fresh checkout has none, and finds it again by what the sources hold; to make
all of it takes half a minute of each test process. JAX finds it again by the program that it is made from.
"""

import shutil
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

import jax
import llvmlite.binding as llvm

from haustra.files import write_atomically
from haustra.models.wall.cache import cache_folder

ROOT = Path(__file__).parents[1]
ROOMS = ("models", "envs")
_SHORTEST = 0.1
"""What takes JAX less than this to compile [s] is not kept."""
_DAYS = 30
"""What JAX compiled is made anew after that many days, so that what nobody asks for any more goes."""


def bring(checkout: Path = ROOT) -> None:
    """Put what was kept beside sources that have none."""
    if not any(_made(checkout)):
        _copy(_kept(), checkout)


def keep(checkout: Path = ROOT) -> None:
    """Keep what there is now."""
    _copy(checkout, _kept())


def lend_to_jax(folder: Path) -> None:
    """Let JAX keep its code in a folder of this process alone, and find there what others kept: it does not write files
    at once, so that another process could read half of one."""
    for path in _of_jax().glob("*-cache"):
        shutil.copyfile(path, folder / path.name)
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", _SHORTEST)
    jax.config.update("jax_persistent_cache_enable_xla_caches", "none")  # they would name the folder in every key


def take_from_jax(folder: Path) -> None:
    """Keep what JAX compiled anew in that folder; throw away what is old."""
    kept = _of_jax()
    kept.mkdir(parents=True, exist_ok=True)
    for path in folder.glob("*-cache"):
        if not (kept / path.name).exists():
            write_atomically(kept / path.name, partial(shutil.copyfile, path))
    for path in kept.glob("*-cache"):
        with suppress(FileNotFoundError):  # another process throws it away, too
            if path.stat().st_mtime < time.time() - _DAYS * 86400:
                path.unlink()


def _of_jax() -> Path:
    """Where its code for this kind of processor is kept."""
    return _kept() / "jax" / llvm.get_host_cpu_name()


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
