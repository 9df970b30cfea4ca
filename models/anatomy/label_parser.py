"""Read one label map with SimpleITK and write the wanted body: run as a child process."""

import sys
from pathlib import Path

from haustra.models.anatomy.child import complain, limit_memory

MAX_VOXELS = 1_000_000_000
"""A whole-body scan at half a millimetre; more does not fit into the memory of a small machine."""
FEW_LABELS = 4096
"""More values than this are grey values of an image, not labels."""


def main(source: str, target: str, label: str) -> int:
    """Write mask (cropped, one voxel of margin), spacing, direction, origin [mm] and labels to `target` (npz)."""
    limit_memory()
    try:
        _write(Path(source), Path(target), int(label) if label else None)
    except BaseException as error:  # whatever the reader stumbles over is a fault of the file
        return complain(error)
    return 0


def _write(source: Path, target: Path, wanted: int | None) -> None:
    import numpy as np
    import SimpleITK as sitk

    sitk.ProcessObject.SetGlobalWarningDisplay(False)
    reader = sitk.ImageFileReader()
    reader.SetFileName(str(source))
    reader.ReadImageInformation()
    size = reader.GetSize()
    if len(size) != 3 or reader.GetNumberOfComponents() != 1:
        raise ValueError(f"it has {len(size)} dimensions and {reader.GetNumberOfComponents()} values a voxel")
    if np.prod(np.array(size, dtype=float)) > MAX_VOXELS:
        raise ValueError(f"it has {'x'.join(map(str, size))} voxels, more than {MAX_VOXELS:.0e}")
    image = reader.Execute()
    array = sitk.GetArrayViewFromImage(image)
    if not np.issubdtype(array.dtype, np.integer):
        whole = np.isfinite(array) & (array == np.round(array))
        if not whole.all():
            raise ValueError("its values are not whole numbers: it is an image, not a label map")
        array = array.astype(np.int64)
    labels, counts = np.unique(array, return_counts=True)
    if len(labels) > FEW_LABELS or labels[0] < 0:
        raise ValueError("its values are grey values: it is an image, not a label map")
    present = labels != 0
    labels, counts = labels[present], counts[present]
    chosen = wanted if wanted is not None or len(labels) != 1 else int(labels[0])
    mask = np.zeros((1, 1, 1), np.uint8)
    low = np.zeros(3, np.int64)
    if chosen is not None and chosen in labels:
        body = array == chosen
        spans = [np.flatnonzero(body.any(axis=tuple(k for k in range(3) if k != axis))) for axis in range(3)]
        box = tuple(slice(int(span[0]), int(span[-1]) + 1) for span in spans)
        mask = np.pad(body[box], 1).astype(np.uint8).transpose(2, 1, 0)
        low = np.array([span[0] - 1 for span in spans[::-1]])
    np.savez(
        target,
        mask=mask,
        low=low,
        labels=labels.astype(np.int64),
        counts=counts,
        spacing=np.array(image.GetSpacing()),
        direction=np.array(image.GetDirection()),
        origin=np.array(image.GetOrigin()),
    )


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
