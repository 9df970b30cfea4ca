"""C3VD's formats: depth, normals, flow, occlusion and poses as its renderer writes them and its loader reads them.

Colonoscopy 3D Video Dataset (Bobrow 2023, doi 10.1016/j.media.2023.102956). Cameras look along +z, with x to the right
and y down; lengths are in millimetres. Sixteen bits are cut off, not rounded, as that renderer does; here half a step
is added first, so that values come back to half a step.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, UInt8, UInt16

from haustra.envs.view.picture.lens import Lens
from haustra.envs.view.picture.renderer import CameraPose
from haustra.errors import InvalidOptionError, UnreadableFileError

LARGEST = 2**16 - 1
"""Largest number of 16 bits."""
DEPTH_MM = 100.0
"""Depth of the largest number [mm]; that and zero are no depths."""
FLOW_PX = 20.0
"""Flow of the largest number [pixels], and less than zero of the smallest, which is no flow."""
OCCLUDING = 255
"""Value of a pixel behind whose wall there is more wall within `DEPTH_MM`."""
TO_C3VD = np.array([1.0, -1.0, -1.0])
"""From right, up and backwards to right, down and ahead."""


def depth_to_bits(depth: Float[np.ndarray, "height width"]) -> UInt16[np.ndarray, "height width"]:
    """Sixteen bits of depths along the axis [m]; what is not finite becomes 0, what is too far the largest number."""
    share = 1e3 * np.where(np.isfinite(depth), depth, 0.0) / DEPTH_MM
    return np.floor(LARGEST * np.clip(share, 0.0, 1.0) + 0.5).astype(np.uint16)


def depth_from_bits(bits: UInt16[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Depth along the axis [m]; NaN where there is none."""
    return np.where((bits == 0) | (bits == LARGEST), np.nan, 1e-3 * DEPTH_MM / LARGEST * bits)


def normals_to_bits(normals: Float[np.ndarray, "height width 3"]) -> UInt16[np.ndarray, "height width 3"]:
    """Sixteen bits a component, -1 to 1, of unit normals in C3VD's axes; 0 where they are not finite."""
    return np.floor(LARGEST * (np.nan_to_num(normals, nan=-1.0) + 1) / 2 + 0.5).astype(np.uint16)


def normals_from_bits(bits: UInt16[np.ndarray, "height width 3"]) -> Float[np.ndarray, "height width 3"]:
    """Normals in C3VD's axes; NaN where there are none."""
    found = bits / LARGEST * 2 - 1.0
    found[(bits == 0).all(axis=-1)] = np.nan
    return found


def flow_to_bits(flow: Float[np.ndarray, "height width 2"]) -> UInt16[np.ndarray, "height width 3"]:
    """Sixteen bits of a flow towards the picture before [pixels], columns and rows; 0 where there is none.

    A flow that does not fit within `FLOW_PX` is none.
    """
    fits = np.all(np.abs(np.nan_to_num(flow, nan=FLOW_PX)) < FLOW_PX, axis=-1, keepdims=True)
    bits = np.zeros((*flow.shape[:2], 3), np.uint16)
    share = (np.where(fits, flow, 0.0) + FLOW_PX) / (2 * FLOW_PX)
    bits[..., :2] = np.where(fits, np.floor(LARGEST * share + 0.5), 0).astype(np.uint16)
    return bits


def flow_from_bits(bits: UInt16[np.ndarray, "height width 3"]) -> Float[np.ndarray, "height width 2"]:
    """Flow towards the picture before [pixels]; NaN where there is none."""
    flow = bits[..., :2] / LARGEST * 2 * FLOW_PX - FLOW_PX
    flow[(bits[..., :2] == 0).all(axis=-1)] = np.nan
    return flow


def occlusion_to_bits(occluding: Bool[np.ndarray, "height width"]) -> UInt8[np.ndarray, "height width"]:
    """Eight bits: `OCCLUDING` or 0."""
    return np.where(occluding, OCCLUDING, 0).astype(np.uint8)


def pose_line(pose: CameraPose) -> str:
    """One line of pose.txt: from the camera's axes to the world, column by column, in millimetres."""
    matrix = np.eye(4)
    matrix[:3, :3] = pose.rotation * TO_C3VD
    matrix[:3, 3] = 1e3 * pose.position
    return ",".join(f"{value:.9g}" for value in matrix.T.ravel())


def read_poses(path: Path) -> list[CameraPose]:
    """Poses of a pose.txt.

    Raises:
        UnreadableFileError: when a line does not hold sixteen numbers.
    """
    found = []
    for line in path.read_text(encoding="ascii").splitlines():
        try:
            matrix = np.array([float(word) for word in line.split(",")]).reshape(4, 4).T
        except ValueError as error:
            raise UnreadableFileError(f"'{path}' has a line that is not sixteen numbers: make it again.") from error
        found.append(CameraPose(1e-3 * matrix[:3, 3], matrix[:3, :3] * TO_C3VD))
    return found


def intrinsics(lens: Lens) -> dict[str, float]:
    """Numbers of a lens as C3VD's loader takes them, at the size of its picture.

    Raises:
        InvalidOptionError: when the lens is of another model than Scaramuzza's.
    """
    if lens.model != "scaramuzza":
        raise InvalidOptionError(f"C3VD has lenses of Scaramuzza's model only, not {lens.model}: take 'cf-hq190l'.")
    (c, d), (e, scale) = lens.stretch
    scaled = {f"a{power}": each * scale ** (1 - power) for power, each in enumerate(lens.coefficients)}
    return {
        "width": lens.width,
        "height": lens.height,
        "cx": lens.centre[0],
        "cy": lens.centre[1],
        **scaled,
        "c": c / scale,
        "d": d / scale,
        "e": e / scale,
    }
