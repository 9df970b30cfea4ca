"""`haustra colon import`."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from haustra.fields import Number, named, vector, whole

if TYPE_CHECKING:
    from haustra.models.anatomy.colon import Colon


@dataclass(frozen=True)
class ColonImport:
    """Make a colon of a lumen surface, a CT label map, or points on the wall."""

    files: tyro.conf.Positional[tuple[Path, ...]]
    """Mesh (STL, OBJ, PLY, GLB, VTK), several of them as pieces of one surface; or one label map (NIfTI, NRRD, MHA)."""
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])]
    """Folder for the colon."""
    units: Literal["mm", "cm", "m", "voxel"] | None = None
    """Units of the coordinates; required for meshes and points, while label maps say theirs."""
    anus: tuple[float, float, float] | None = vector(*[Number("file's units", -1e6, 1e6)] * 3, default=None)
    """Position of the anus in the file's units (label maps: mm, left-posterior-superior); found when not given."""
    landmark: Annotated[tuple[tuple[str, float, float, float], ...], tyro.conf.arg(aliases=["--landmarks"])] = named(
        "file's units", -1e6, 1e6, default=(), count=3
    )
    """Landmark as NAME X Y Z, any number of times over: overrides what is found; also ileocaecal_valve."""
    spacing_mm: tuple[float, float, float] | None = vector(*[Number("mm", 1e-3, 100.0)] * 3, default=None)
    """Size of a voxel along x, y and z [mm]; needed with units voxel."""
    label: int | None = whole(-(2**31), 2**31, default=None)
    """Value of the colon's voxels, in a label map that holds several values."""
    points: bool = False
    """Read the files as points on the wall (XYZ, CSV, PLY, VTK), not as triangles."""
    insufflate: str | None = None
    """Open the lumen to a diameter ('14mm') or by a pressure ('20mmHg', '2.7kPa')."""
    remesh: bool = False
    """Make the surface's triangles anew, their size fitted to curvature and radius."""
    name: str | None = None
    """Name of the colon; the file's name when not given."""
    json: bool = False
    """Print one JSON document on stdout."""

    def __call__(self) -> dict:
        """Import, save, and return the measures."""
        from haustra.files import prepare_folder
        from haustra.models.anatomy.insufflation import insufflated, opening_from
        from haustra.models.anatomy.remesh import remeshed

        opening = None if self.insufflate is None else opening_from(self.insufflate)
        prepare_folder(self.output)
        began = time.perf_counter()
        extra = {}
        with _stages() as progress:
            colon = self._colon(progress)
            if opening is not None:
                progress("opening the lumen")
                colon = insufflated(colon, opening)
            if self.remesh:
                progress("fitting the triangles")
                colon, report = remeshed(colon)
                extra = {"remesh": report}
        return {**_save(colon, self.output, began), **extra}

    def _colon(self, progress: Callable[[str], None]) -> "Colon":
        from haustra.errors import InvalidOptionError
        from haustra.models.anatomy.label_colon import import_label_map
        from haustra.models.anatomy.label_map import is_label_map
        from haustra.models.anatomy.mesh_colon import import_colon

        places = {name: (x, y, z) for name, x, y, z in self.landmark}
        if any(map(is_label_map, self.files)):
            if len(self.files) > 1 or self.units or self.spacing_mm or self.points:
                raise InvalidOptionError(
                    "A label map is one file and says its own units: leave out --units, --spacing-mm and --points."
                )
            return import_label_map(
                next(iter(self.files)),
                label=self.label,
                anus=self.anus,
                places=places,
                name=self.name,
                progress=progress,
            )
        if self.units is None:
            raise InvalidOptionError("Mesh files do not say their units: name them with --units mm, cm, m or voxel.")
        if self.label is not None:
            raise InvalidOptionError("--label goes with a label map (NIfTI, NRRD, MHA).")
        return import_colon(
            self.files,
            units=self.units,
            spacing_mm=self.spacing_mm,
            anus=self.anus,
            places=places,
            cloud=self.points,
            name=self.name,
            progress=progress,
        )


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
