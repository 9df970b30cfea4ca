"""Pictures from the tip's camera: colour by the renderer of `haustra.envs.picture`, depth by rays into the tables."""

import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.picture.tip import tip_view
from haustra.envs.tasks.bank import Bank
from haustra.envs.tasks.sight import RANGE, Sight
from haustra.models.anatomy.colon import Surface

Eye = tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]
"""Place of the camera [m], and columns: wire 'up', wire 'left', viewing direction."""
_DEPTH_STEPS = RANGE * (np.arange(1, 41) / 40) ** 1.3


class Pictures:
    """Draws what is before a tip."""

    def __init__(self, bank: Bank, sight: Sight, field_of_view_deg: float) -> None:
        """Surfaces are made when a case is first looked at."""
        self._bank, self._sight = bank, sight
        self._view = min(field_of_view_deg, 170.0)
        self._surfaces: dict[int, Surface] = {}

    def colour(self, case: int, eye: Eye, size: int) -> UInt8[np.ndarray, "size size 3"]:
        """A fisheye picture; wire 'up' is up."""
        if case not in self._surfaces:
            self._surfaces[case] = self._bank.cases[case].colon().lumen
        place, frame = eye
        camera = np.column_stack([-frame[:, 1], frame[:, 0], -frame[:, 2]])  # right, up, backwards
        return tip_view(self._surfaces[case], place, camera, self._view, size=size)

    def depth(self, case: int, eye: Eye, arc: float, size: int) -> Float[np.ndarray, "size size"]:
        """Distance to the wall in each pixel of the same picture [m]; zero outside the lens's circle."""
        place, frame = eye
        grid = (np.arange(size) + 0.5) / size * 2 - 1
        right, up = np.meshgrid(grid, -grid)
        off = np.hypot(right, up)
        angle = np.minimum(off, 1.0) * np.radians(self._view / 2)
        scale = np.sin(angle) / np.maximum(off, 1e-9)
        local = np.stack([up * scale, -right * scale, np.cos(angle)], axis=-1).reshape(-1, 3)
        found = self._sight.distances(
            np.array([case]), place[None], (local @ frame.T)[None], np.array([arc]), _DEPTH_STEPS
        )
        return np.where(off <= 1, found.reshape(size, size), 0.0)

    def both(self, case: int, eye: Eye, arc: float, size: int) -> UInt8[np.ndarray, "size size 4"]:
        """Colour, and depth over `RANGE` as a fourth channel."""
        depth = np.rint(255 * self.depth(case, eye, arc, size) / RANGE).astype(np.uint8)
        return np.dstack([self.colour(case, eye, size), depth])
