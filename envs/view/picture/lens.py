"""The tip camera's fisheye lens: angles from the axis are in proportion to the distance from the picture's middle."""

from functools import cache

import numpy as np
from jaxtyping import Bool, Float


@cache
def lens_rays(
    field_of_view_deg: float, size: int
) -> tuple[Float[np.ndarray, "size size 3"], Bool[np.ndarray, "size size"]]:
    """Unit vectors of all pixels in the tip's frame (wire 'up', wire 'left', ahead); and which are within the lens.

    Args:
        field_of_view_deg: full angle over the diameter of the picture [degrees].
        size: rows and columns; wire 'up' is up.
    """
    grid = (np.arange(size) + 0.5) / size * 2 - 1
    right, up = np.meshgrid(grid, -grid)
    off = np.hypot(right, up)
    angle = np.minimum(off, 1.0) * np.radians(field_of_view_deg / 2)
    scale = np.sin(angle) / np.maximum(off, 1e-9)
    return np.stack([up * scale, -right * scale, np.cos(angle)], axis=-1), off <= 1


def camera_axes(frame: Float[np.ndarray, "*worlds 3 3"]) -> Float[np.ndarray, "*worlds 3 3"]:
    """Right, up and backwards of the camera, as columns, from those of its tip: wire 'up', wire 'left', ahead."""
    return np.stack([-frame[..., 1], frame[..., 0], -frame[..., 2]], axis=-1)
