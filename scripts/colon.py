"""`haustra colon import` and `haustra colon grow`."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

if TYPE_CHECKING:
    from haustra.models.anatomy.colon import Colon


@dataclass(frozen=True)
class ColonImport:
    """Make a colon of a closed lumen surface (STL, OBJ, PLY)."""

    file: tyro.conf.Positional[Path]
    """The mesh file."""
    units: Literal["mm", "cm", "m", "voxel"]
    """Units of its coordinates."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the colon."""
    anus: tuple[float, float, float] | None = None
    """Position of the anus in the file's units; found automatically when left out."""
    spacing_mm: tuple[float, float, float] | None = None
    """Size of a voxel along x, y and z [mm]; needed with units voxel."""
    name: str | None = None
    """What to call the colon; the file's name when left out."""
    json: bool = False
    """Print one JSON document on stdout."""

    def __call__(self) -> dict:
        """Import, save, and return the measures."""
        from haustra.files import prepare_folder
        from haustra.models.anatomy.mesh_colon import import_colon

        prepare_folder(self.output)
        began = time.perf_counter()
        with _stages() as progress:
            colon = import_colon(
                self.file,
                units=self.units,
                spacing_mm=self.spacing_mm,
                anus=self.anus,
                name=self.name,
                progress=progress,
            )
        return _save(colon, self.output, began)


@dataclass(frozen=True)
class ColonGrow:
    """Grow an anatomical colon from a seed."""

    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the colon."""
    seed: int = 0
    """Same seed, same colon."""
    json: bool = False
    """Print one JSON document on stdout."""

    def __call__(self) -> dict:
        """Grow, save, and return the measures."""
        from haustra.files import prepare_folder
        from haustra.models.anatomy.grown import grow_colon

        prepare_folder(self.output)
        began = time.perf_counter()
        with _stages() as progress:
            colon = grow_colon(seed=self.seed, progress=progress)
        return _save(colon, self.output, began)


def _save(colon: "Colon", folder: Path, began: float) -> dict:
    from haustra.models.anatomy.properties import describe
    from haustra.models.anatomy.store import save_colon

    measures = describe(colon)
    save_colon(colon, folder)
    return {**measures, "folder": str(folder), "seconds": time.perf_counter() - began}


@contextmanager
def _stages() -> Iterator[Callable[[str], None]]:
    """A spinner on stderr that names the stage at work."""
    from rich.console import Console

    with Console(stderr=True).status("starting") as status:
        yield lambda stage: status.update(stage)
