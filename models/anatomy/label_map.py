"""A CT label map becomes a lumen surface."""

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from haustra.errors import InvalidMeshError, InvalidOptionError, MissingDependencyError, UnreadableFileError
from haustra.models.anatomy.child import arrays_from
from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.isosurface import isosurface, leashed_smoothing, simplified
from haustra.models.anatomy.mesh_file import MAX_BYTES
from haustra.models.anatomy.repair import Repaired, signed_volume

SUFFIXES = (".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd")
"""NIfTI, NRRD and MetaImage."""
SECOND_BODY = 0.2
"""A second body with at least this share of the first is no crumb: one of them may not be left out in silence."""
LEASH = 0.5
"""A vertex moves at most this share of a voxel along each axis when the staircase is taken away."""
SIMPLIFICATION = 0.15
"""Triangles are merged as long as the surface moves less than this share of the smallest voxel side."""
LARGEST_VOXEL = 5.0
"""A coarser voxel side [mm] resolves no colon; it is probably a wrong unit."""


@dataclass(frozen=True)
class LabelMap:
    """One body of a label map and where its voxels are."""

    mask: Bool[np.ndarray, "x y z"]
    """Voxels of the body, with an empty layer around."""
    to_metres: Float[np.ndarray, "3 3"]
    """From steps along the voxel axes to the patient's axes: left, posterior, superior [m]."""
    origin: Float[np.ndarray, "3"]
    """Centre of the first voxel of `mask` [m]."""
    spacing: Float[np.ndarray, "3"]
    """Size of a voxel [m]."""


def is_label_map(file: Path) -> bool:
    """Whether a file is a label map by its name."""
    return file.name.lower().endswith(SUFFIXES)


def read_label_map(file: Path, *, label: int | None = None) -> LabelMap:
    """Read one label of a NIfTI, NRRD or MetaImage file, with its spacing and orientation.

    Args:
        file: The label map.
        label: Value of the colon's voxels; may be left out when there is only one.

    Raises:
        MissingDependencyError: when SimpleITK is not installed.
        UnreadableFileError: when the file cannot be read as a label map.
        InvalidOptionError: when the label is not there, or must be chosen.
        InvalidMeshError: when its voxels have an impossible size.
    """
    if importlib.util.find_spec("SimpleITK") is None:
        raise MissingDependencyError("Label maps need SimpleITK: install it with 'pip install haustra[ct]'.")
    _check(file)
    arrays = arrays_from("haustra.models.anatomy.label_parser", file, "label map", "" if label is None else str(label))
    labels, counts = arrays["labels"].tolist(), arrays["counts"].tolist()
    if not labels:
        raise InvalidMeshError(f"'{file}' holds no label but the background: it shows no colon.")
    listed = ", ".join(f"{value} ({count} voxels)" for value, count in list(zip(labels, counts, strict=True))[:12])
    if label is None and len(labels) > 1:
        raise InvalidOptionError(f"'{file}' holds {len(labels)} labels: choose the colon's. There are {listed}.")
    if label is not None and label not in labels:
        raise InvalidOptionError(f"'{file}' holds no label {label}. There are {listed}.")
    spacing, direction = arrays["spacing"], arrays["direction"].reshape(3, 3)
    if not (np.isfinite(spacing).all() and spacing.min() > 0 and spacing.max() <= LARGEST_VOXEL):
        raise InvalidMeshError(
            f"'{file}' has voxels of {' x '.join(f'{s:.3g}' for s in spacing)} mm: "
            "its header must give their size in mm."
        )
    to_metres = direction * spacing * 1e-3
    origin = arrays["origin"] * 1e-3 + to_metres @ arrays["low"]
    if not np.isfinite(to_metres).all() or not np.isfinite(origin).all():
        raise InvalidMeshError(f"'{file}' has an orientation that is not finite: export it again.")
    return LabelMap(arrays["mask"].astype(bool), to_metres, origin, spacing * 1e-3)


def lumen_of_label(label_map: LabelMap) -> Repaired:
    """The closed surface of the largest body of a label map, within a voxel of its voxels' faces, and what was done.

    Raises:
        InvalidMeshError: when there are two bodies of comparable size.
    """
    mask, notes = _one_body(label_map)
    filled = ndimage.binary_fill_holes(mask)
    assert filled is not None
    if cavities := int(filled.sum() - mask.sum()):
        notes.append(f"Filled cavities of {cavities * float(np.prod(label_map.spacing)) * 1e6:.2f} mL.")
    found = isosurface(np.where(filled, 0.5, -0.5))
    smooth = leashed_smoothing(found, LEASH)
    vertices = smooth.vertices @ label_map.to_metres.T + label_map.origin
    surface = simplified(Surface(vertices, smooth.faces), SIMPLIFICATION * float(label_map.spacing.min()))
    if len(surface.faces) == 0:
        raise InvalidMeshError("The label is a few voxels, not a colon: choose another label.")
    if signed_volume(surface.vertices, surface.faces) < 0:  # the axes of the voxels may be left-handed
        surface = Surface(surface.vertices, surface.faces[:, ::-1].copy())
    voxel = " x ".join(f"{side * 1e3:.3g}" for side in label_map.spacing)
    notes.append(f"The surface is that of voxels of {voxel} mm: walls thinner than one are lost.")
    return Repaired(surface, tuple(notes))


def _one_body(label_map: LabelMap) -> tuple[Bool[np.ndarray, "x y z"], list[str]]:
    """The largest body joined through faces of voxels."""
    marked = np.empty(label_map.mask.shape, np.int32)
    count = int(ndimage.label(label_map.mask, output=marked))  # type: ignore[arg-type]
    if count == 1:
        return label_map.mask, []
    size = np.bincount(marked.ravel())
    size[0] = 0
    litres = np.sort(size)[::-1][:3] * float(np.prod(label_map.spacing)) * 1e3
    if litres[1] >= SECOND_BODY * litres[0]:
        raise InvalidMeshError(
            f"The label holds separate bodies of {litres[0]:.2f} L and {litres[1]:.2f} L: a colon is one. Join them "
            "where it is collapsed, or delete what is not colon."
        )
    note = f"Kept the largest of {count} separate bodies; {(size.sum() - size.max()) / size.sum():.1%} were left out."
    return marked == size.argmax(), [note]


def _check(file: Path) -> None:
    if file.is_dir():
        raise UnreadableFileError(f"'{file}' is a folder: name a label map ({', '.join(SUFFIXES)}).")
    try:
        size = file.stat().st_size
    except OSError as error:
        raise UnreadableFileError(f"Cannot read '{file}': {error.strerror or error}.") from error
    if size == 0:
        raise UnreadableFileError(f"'{file}' is empty: export the label map again.")
    if size > MAX_BYTES:
        raise UnreadableFileError(f"'{file}' has {size / 1e9:.1f} GB, more than {MAX_BYTES / 1e9:.0f}: crop it.")
