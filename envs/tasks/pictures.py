"""Pictures from the tip's camera.

Colour by the renderer of `haustra.envs.view.picture`, depth by rays into the tables.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8

from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.sight import DEPTH_STEPS, RANGE, Sight
from haustra.envs.view.picture.lens import camera_axes, lens_rays
from haustra.envs.view.picture.tip import tip_view
from haustra.models.anatomy.colon import Surface

Eye = tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]
"""Place of the camera [m], and columns: wire 'up', wire 'left', viewing direction."""


class Pictures:
    """Draws what is before a tip."""

    def __init__(self, bank: ColonSet, sight: Sight, field_of_view_deg: float) -> None:
        """Surfaces are made when a case is first looked at."""
        self._bank, self._sight = bank, sight
        self.view = min(field_of_view_deg, 170.0)
        """Full angle over the diameter of a picture [degrees]."""
        self._surfaces: dict[int, Surface] = {}

    def colour(self, case: int, eye: Eye, size: int) -> UInt8[np.ndarray, "size size 3"]:
        """A fisheye picture; wire 'up' is up."""
        if case not in self._surfaces:
            self._surfaces[case] = self._bank.cases[case].colon().lumen
        place, frame = eye
        return tip_view(self._surfaces[case], place, camera_axes(frame), self.view, size=size)

    def depth(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        frame: Float[np.ndarray, "worlds 3 3"],
        arc: Float[np.ndarray, " worlds"],
        size: int,
        at_rest: Callable[[Any, Any], Any] | None = None,
    ) -> Float[np.ndarray, "worlds size size"]:
        """Distance to the wall in each pixel of the same pictures [m]; zero outside the lens's circle.

        Colons that have moved are drawn with `at_rest`, as `haustra.envs.tasks.sight.march` takes it.
        """
        rays, within = lens_rays(self.view, size)
        directions = rays.reshape(-1, 3) @ frame.swapaxes(-1, -2)
        found = self._sight.distances(case, eye, directions, arc, DEPTH_STEPS, at_rest)
        return np.where(within, found.reshape(-1, size, size), 0.0)

    def both(self, case: int, eye: Eye, arc: float, size: int) -> UInt8[np.ndarray, "size size 4"]:
        """Colour, and depth over `RANGE` as a fourth channel."""
        place, frame = eye
        depth = self.depth(np.array([case]), place[None], frame[None], np.array([arc]), size)
        return np.dstack([self.colour(case, eye, size), in_bytes(depth[0])])


def in_bytes(depth: Float[np.ndarray, "*pixels"]) -> UInt8[np.ndarray, "*pixels"]:
    """Depth [m] over `RANGE`, as a picture has it."""
    return np.rint(255 * depth / RANGE).astype(np.uint8)
