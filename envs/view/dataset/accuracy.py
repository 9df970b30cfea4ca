"""How exact a data set is, measured from its files alone: what was written is read again and held against itself.

- Reprojection: a pixel's place by its depth and the camera's pose, taken along with its triangle to the picture before
  by the vertices of both, and projected there by that picture's pose and the lens, against the flow that was written.
- Depth: against MuJoCo's rays to the triangles of the vertices that were written, from the pose that was written.
- Normals: against the triangles of the vertices that were written.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from haustra.envs.view.dataset.clip import POSES, read_frame, read_plain
from haustra.envs.view.dataset.formats import TO_C3VD, read_poses
from haustra.envs.view.picture.lens import Lens
from haustra.envs.view.picture.renderer import CameraPose
from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.rays import LumenRays

RAYS = 2000
"""Pixels of a picture that MuJoCo's rays are cast for."""


@dataclass(frozen=True)
class DatasetAccuracy:
    """Largest differences found; of all pixels unless said otherwise."""

    reprojection_px: float
    """Largest difference between flows [pixels]; 0 where there was none."""
    depth_error_mm: float
    """Largest difference between depths along the axis, in every eighth picture, of pixels at random [mm]."""
    normals_error_deg: float
    """Largest angle between normals [degrees]."""
    round_trip_mm: float
    """Largest difference of depths in sixteen bits from those in floating point [mm]."""
    flows: int
    """Pixels whose flow was looked at."""

    def joined(self, other: "DatasetAccuracy") -> "DatasetAccuracy":
        """The larger of each difference."""
        largest = {name: max(value, getattr(other, name)) for name, value in vars(self).items()}
        return DatasetAccuracy(**{**largest, "flows": self.flows + other.flows})


def clip_accuracy(folder: Path, faces: np.ndarray, lens: Lens, *, seed: int = 0) -> DatasetAccuracy:
    """Measure one clip.

    Args:
        folder: of the clip.
        faces: corners of the triangles of its mesh.
        lens: what it was seen through.
        seed: of the choice of pixels.
    """
    poses = read_poses(folder / POSES)
    random = np.random.default_rng(seed)
    found = DatasetAccuracy(0.0, 0.0, 0.0, 0.0, 0)
    before: np.ndarray | None = None
    for frame, pose in enumerate(poses):
        held, plain = read_frame(folder, frame), read_plain(folder, frame)
        vertices, depth = plain["vertices_m"].astype(float), held["depth"]
        known = np.isfinite(depth)
        corners = vertices[faces[plain["triangle"][known]]]
        away = _away(depth, lens)[known]
        flow = 0.0, 0
        if before is not None and "flow" in held:
            flow = _reprojection(away, corners, faces, plain, known, held["flow"], before, pose, poses[frame - 1], lens)
        ray = _ray_error(vertices, faces, pose, depth, known, lens, random) if frame % 8 == 0 else 0.0
        turned = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ pose.rotation * TO_C3VD
        turned /= np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-300)
        given = held["normals"][known]
        apart = np.linalg.norm(np.cross(turned, given), axis=1)
        now = DatasetAccuracy(
            reprojection_px=flow[0],
            depth_error_mm=ray,
            normals_error_deg=float(np.degrees(np.arcsin(np.minimum(apart, 1.0))).max(initial=0.0)),
            round_trip_mm=float(1e3 * np.abs(depth - plain["depth_m"])[known].max(initial=0.0)),
            flows=flow[1],
        )
        found, before = found.joined(now), vertices
    return found


def _away(depth: np.ndarray, lens: Lens) -> np.ndarray:
    """From the camera to what each pixel shows, in its axes [m]."""
    return lens.grid * (depth / -lens.grid[..., 2])[..., None]


def _reprojection(
    away: np.ndarray,
    corners: np.ndarray,
    faces: np.ndarray,
    plain: dict[str, np.ndarray],
    known: np.ndarray,
    flow: np.ndarray,
    before: np.ndarray,
    pose: CameraPose,
    earlier: CameraPose,
    lens: Lens,
) -> tuple[float, int]:
    """Largest difference of flows [pixels], and how many there were."""
    points = pose.position + away @ pose.rotation.T
    weights = _weights(points, corners)
    then = np.einsum("nk,nkd->nd", weights, before[faces[plain["triangle"][known]]])
    pixels = lens.pixels(np, (then - earlier.position) @ earlier.rotation)
    rows, columns = np.nonzero(known)
    expected, given = pixels - np.stack([columns, rows], axis=1), flow[known]
    told = np.isfinite(given).all(axis=1)
    return float(np.linalg.norm(expected - given, axis=1)[told].max(initial=0.0)), int(told.sum())


def _weights(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Barycentric coordinates of points in the planes of triangles."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    away = points - corners[:, 0]
    normal = np.cross(first, second)
    square = np.maximum((normal * normal).sum(1), 1e-300)
    b = (np.cross(away, second) * normal).sum(1) / square
    c = (np.cross(first, away) * normal).sum(1) / square
    return np.stack([1 - b - c, b, c], axis=1)


def _ray_error(
    vertices: np.ndarray,
    faces: np.ndarray,
    pose: CameraPose,
    depth: np.ndarray,
    known: np.ndarray,
    lens: Lens,
    random: np.random.Generator,
) -> float:
    """Largest difference of depths from MuJoCo's rays [mm]."""
    rays = LumenRays(Surface(vertices, faces))
    chosen = np.argwhere(known)
    chosen = chosen[random.choice(len(chosen), min(RAYS, len(chosen)), replace=False)]
    ahead = lens.grid[chosen[:, 0], chosen[:, 1]]
    distance = rays.cast(pose.position[None], (ahead @ pose.rotation.T)[None])[0]
    return float(1e3 * np.abs(distance * -ahead[:, 2] - depth[chosen[:, 0], chosen[:, 1]]).max(initial=0.0))
