"""Damaged label maps, written without any library."""

import struct

import numpy as np

from haustra.scripts.bench.fuzz.spoiling import spoil


def label_file(rng: np.random.Generator) -> tuple[str, bytes]:
    """Suffix and content of a damaged label map, written without any library."""
    shape = tuple(int(n) for n in rng.integers(1, 24, size=3))
    kind = int(rng.integers(8))
    array = np.zeros(shape, np.uint8)
    if kind == 1:
        array[:] = rng.integers(0, 256, size=shape)
    elif kind == 2:
        array[:] = rng.random(shape) < 0.5
    elif kind == 3:
        array[: shape[0] // 3] = 1
        array[2 * shape[0] // 3 + 1 :] = 1
    elif kind >= 4:
        array[1:-1, 1:-1, 1:-1] = int(rng.integers(1, 4))
    sides = rng.choice(
        [0.7, 1.0, 5.0, 1000.0, 0.0, -1.0, float("nan")], p=[0.3, 0.3, 0.2, 0.05, 0.05, 0.05, 0.05], size=3
    )
    suffix = str(rng.choice(["nii", "nrrd", "mha"]))
    content = {"nii": _nifti, "nrrd": _nrrd, "mha": _mha}[suffix](array, sides)
    return suffix, spoil(content, rng) if rng.random() < 0.5 else content


def _nifti(array: np.ndarray, sides: np.ndarray) -> bytes:
    head = bytearray(352)
    struct.pack_into("<i", head, 0, 348)
    struct.pack_into("<8h", head, 40, 3, *array.shape, 1, 1, 1, 1)
    struct.pack_into("<hh", head, 70, 2, 8)
    struct.pack_into("<8f", head, 76, 1.0, *sides, 1, 1, 1, 1)
    struct.pack_into("<f", head, 108, 352.0)
    head[344:348] = b"n+1\0"
    return bytes(head) + array.tobytes(order="F")


def _nrrd(array: np.ndarray, sides: np.ndarray) -> bytes:
    sizes, spacings = " ".join(map(str, array.shape)), " ".join(map(str, sides))
    head = f"NRRD0004\ntype: uint8\ndimension: 3\nsizes: {sizes}\nspacings: {spacings}\nencoding: raw\n\n"
    return head.encode() + array.tobytes(order="F")


def _mha(array: np.ndarray, sides: np.ndarray) -> bytes:
    size, spacing = " ".join(map(str, array.shape)), " ".join(map(str, sides))
    head = f"ObjectType = Image\nNDims = 3\nBinaryData = True\nDimSize = {size}\nElementSpacing = {spacing}\n"
    return (head + "ElementType = MET_UCHAR\nElementDataFile = LOCAL\n").encode() + array.tobytes(order="F")
