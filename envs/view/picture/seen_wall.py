"""Whether a camera in the colon sees mucosa: which share of its picture is the wall's inner side, and from where.

A renderer of lumens draws inner sides only, so that a camera that stands outside looks through the wall beside it into
other loops, and its picture looks well. Whether it stands within is asked of the surface itself, by how often it winds
around the camera. Where loops of a colon pass through each other, another loop's wall may stand across what is seen.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from haustra.envs.view.picture.lens import Lens
from haustra.envs.view.picture.renderer import CameraPose, RayRenderer
from haustra.envs.view.picture.surface import LumenSurface
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.anatomy.winding import winding_numbers
from haustra.models.wall.signed_distance import surface_arcs

_WITHIN = 0.5
"""Cameras that a surface winds around at least so often are within it [1]."""


class SeenWall(NamedTuple):
    """What a camera sees."""

    mucosa: float
    """Share of the pixels within the lens that see the wall's inner side [1]; the rest looks out."""
    across: float
    """Share of them before whose mucosa, if any, an outer side of the wall stands [1]."""
    outside: bool
    """Whether the camera stands outside the colon."""


class WallCheck:
    """Looks at one colon, wherever it is, from both sides of its wall."""

    def __init__(self, colon: Colon, lens: Lens) -> None:
        """Take a colon at rest, and a lens at the size of the pictures."""
        inner, arcs = colon.lumen, surface_arcs(colon)
        sides = inner, Surface(inner.vertices, np.ascontiguousarray(inner.faces[:, ::-1]))
        self._within, self._faces = lens.within, inner.faces
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
        around = winding_numbers(Surface(vertices, self._faces), pose.position[None])[0]
        return SeenWall(float(np.isfinite(inner).mean()), float((outer < inner).mean()), bool(around < _WITHIN))
