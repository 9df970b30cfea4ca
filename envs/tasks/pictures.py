"""Pictures from the tip's camera.

Colour by the renderer of `haustra.envs.view.picture`, depth by rays into the tables.
"""

import numpy as np
from jaxtyping import Float, Int, UInt8

from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.sight import Sight, in_bytes
from haustra.envs.view.picture.lens import camera_axes
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
    ) -> Float[np.ndarray, "worlds size size"]:
        """Distance to the wall in each pixel of the same pictures [m], of colons at rest; zero outside the circle."""
        return self._sight.depth(case, eye, frame, arc, field_of_view_deg=self.view, size=size)

    def both(self, case: int, eye: Eye, arc: float, size: int) -> UInt8[np.ndarray, "size size 4"]:
        """Colour, and depth over `RANGE` as a fourth channel."""
        place, frame = eye
        depth = self.depth(np.array([case]), place[None], frame[None], np.array([arc]), size)
        return np.dstack([self.colour(case, eye, size), in_bytes(depth[0])])
