"""Whether a camera in the colon sees mucosa: which share of its picture is the wall's inner side, and which its outer.

A renderer of lumens draws inner sides only, so that a camera that stands outside looks through the wall beside it into
other loops, and its picture looks well. Here both sides are drawn, and the nearer counts.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.envs.view.picture.lens import Lens
from haustra.envs.view.picture.renderer import CameraPose, RayRenderer
from haustra.envs.view.picture.surface import LumenSurface
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.wall.signed_distance import surface_arcs


class SeenWall(NamedTuple):
    """Shares of the pixels within a lens [1]; the rest looks out at the anus."""

    inner: float
    """Of those that see the inner side of the wall, which is mucosa."""
    outer: float
    """Of those that see it from outside."""


class WallCheck:
    """Looks at one colon, wherever it is, from both sides of its wall."""

    def __init__(self, colon: Colon, lens: Lens) -> None:
        """Take a colon at rest, and a lens at the size of the pictures."""
        inner, arcs = colon.lumen, surface_arcs(colon)
        sides = inner, Surface(inner.vertices, np.ascontiguousarray(inner.faces[:, ::-1]))
        self._within = lens.within
        self._sides = [RayRenderer(LumenSurface(side, arcs), lens, threads=1) for side in sides]

    def look(self, vertices: Float[np.ndarray, "vertices 3"], pose: CameraPose) -> SeenWall:
        """What is seen from there.

        Args:
            vertices: of the colon's surface, where they are now [m].
            pose: of the camera.
        """
        for side in self._sides:
            side.place(vertices)
        inner, outer = (side.look(pose).distance[self._within] for side in self._sides)
        return SeenWall(float((inner < outer).mean()), float((outer < inner).mean()))
