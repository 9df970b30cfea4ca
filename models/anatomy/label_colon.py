"""A CT label map becomes a colon."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.label_map import lumen_of_label, read_label_map
from haustra.models.anatomy.landmarks import landmark_positions
from haustra.models.anatomy.mesh_colon import colon_from_surface
from haustra.provenance import Provenance, file_hash


def import_label_map(
    file: Path,
    *,
    label: int | None = None,
    anus: tuple[float, float, float] | None = None,
    places: Mapping[str, tuple[float, float, float]] | None = None,
    name: str | None = None,
    progress: Callable[[str], None] = lambda stage: None,
) -> Colon:
    """Make a colon of one label of a CT label map.

    Args:
        file: NIfTI, NRRD or MetaImage; size, orientation and place of its voxels are kept.
        label: Value of the colon's voxels; may be left out when there is only one.
        anus: Position of the anus [mm] in the patient's axes (left, posterior, superior); found when left out.
        places: Positions of landmarks [mm] in the same axes, by name; they override what is found.
        name: What to call the colon; the file's name when left out.
        progress: Called with the name of each stage as it begins.

    Raises:
        HaustraError: as `read_label_map`, `lumen_of_label` and `colon_from_surface`.
    """
    named = {"anus": anus} if anus is not None else {}
    positions = landmark_positions({**(places or {}), **named}, 1e-3 * np.eye(3))
    progress("reading")
    label_map = read_label_map(file, label=label)
    progress("finding the surface")
    found = lumen_of_label(label_map)
    configuration = {"method": "label map", "label": label, "anus": anus, "places": dict(places or {})}
    return colon_from_surface(
        found.surface,
        name=name or file.name.split(".")[0],
        provenance=Provenance(inputs={file.name: file_hash(file)}, configuration=configuration),
        positions=positions,
        units="mm",
        notes=found.notes,
        progress=progress,
    )
