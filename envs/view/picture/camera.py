"""Cameras: where a point of the world falls in the image. MuJoCo's convention: looks along -z, y up, x right."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Camera:
    """Where a camera stands and how it is turned."""

    position: Float[np.ndarray, "3"]
    """Optical centre [m]."""
    rotation: Float[np.ndarray, "3 3"]
    """Columns are the camera's right, up and backward directions in the world."""
    field_of_view_deg: float
    """Full angle over the image's height [degrees]."""

    def perspective(
        self, points: Float[np.ndarray, "points 3"], *, width: int, height: int
    ) -> tuple[Float[np.ndarray, "points 2"], Float[np.ndarray, " points"]]:
        """Pinhole image (column, row) [pixels] and depth along the axis [m]; NaN behind the camera."""
        local = (points - self.position) @ self.rotation
        depth = -local[:, 2]
        focal = height / 2 / np.tan(np.radians(self.field_of_view_deg) / 2)
        ahead = np.where(depth > 0, depth, np.nan)
        column = width / 2 + focal * local[:, 0] / ahead
        row = height / 2 - focal * local[:, 1] / ahead
        return np.stack([column, row], axis=1), depth


def looking(direction: Float[np.ndarray, "3"], up: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Rotation of a camera that looks along `direction` with `up` upwards in the image."""
    backward = -direction / np.linalg.norm(direction)
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(backward, right), backward], axis=1)


def unit(vectors: Float[np.ndarray, "... 3"]) -> Float[np.ndarray, "... 3"]:
    """Vectors divided by their length; zero stays zero."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
