"""The colon of an episode, frame by frame: its surface, where the lens is in it, and how it looks from outside."""

import numpy as np
from jaxtyping import Float

from haustra.envs.console.stage import Stage
from haustra.envs.console.vehicle import Surroundings
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.envs.tasks.case import TabulatedColon
from haustra.envs.view.picture.inside import lens_inside
from haustra.envs.view.picture.lens import Lens
from haustra.envs.view.picture.outside import OutsideView, default_rotation
from haustra.envs.view.picture.surface import LumenSurface, MovingSurface
from haustra.models.anatomy.colon import Surface
from haustra.models.wall.lumen_table import stack
from haustra.models.wall.signed_distance import surface_arcs


def stage_of(
    case: TabulatedColon,
    displacement: Float[np.ndarray, "frames nodes 7"] | None,
    lens: Lens,
    size: tuple[int, int],
) -> "StillColon | MovingColon":
    """A colon to draw an episode in.

    Args:
        case: the colon.
        displacement: displacements of its axis [m], frame by frame; None where it is fixed in space.
        lens: of the tip.
        size: columns and rows of the view from outside.
    """
    return StillColon(case, size) if displacement is None else MovingColon(case, displacement, lens, size)


class StillColon:
    """A colon that is fixed in space."""

    def __init__(self, case: TabulatedColon, size: tuple[int, int]) -> None:
        """Draw it from outside, once."""
        self._case, colon = case, case.colon()
        self.surface = LumenSurface(colon.lumen, surface_arcs(colon))
        """What the tip sees."""
        rotation = default_rotation(colon.lumen, case.points)
        self._outside = OutsideView(colon.lumen, rotation, width=size[0], height=size[1])

    def at(self, index: int, tip: Float[np.ndarray, "3"], arc: float) -> tuple[np.ndarray, OutsideView]:
        """Place of the lens [m], and the view from outside, in a frame with the tip there."""
        return _inside(self._case, tip, arc), self._outside


class MovingColon:
    """A colon on its mesentery: drawn anew in every frame, by a camera that stands still."""

    def __init__(
        self,
        case: TabulatedColon,
        displacement: Float[np.ndarray, "frames nodes 7"],
        lens: Lens,
        size: tuple[int, int],
    ) -> None:
        """Find a camera that sees all of it at the beginning, in the middle and at the end."""
        tables = stack([case.with_mesentery()])
        assert tables.mesentery is not None
        # Among longer colons an axis has nodes added at its end.
        self._displacement = at = displacement[:, : tables.mesentery.nodes.shape[1]]
        self._case, self._size = case, size
        rest = case.colon()
        self._colon = CurrentColon(rest, tables, *case.own_axes)
        self.surface = MovingSurface(rest, tables, *case.own_axes)
        """What the tip sees, as of the frame that was asked for last."""
        self._rings = Stage(Surroundings(rest, tables, *case.own_axes, case.device_radius, lens))
        self._rotation = default_rotation(rest.lumen, case.points)
        self._framed = np.vstack([self._rings.vertices(moved) for moved in (at[0], at[len(at) // 2], at[-1])])

    def at(self, index: int, tip: Float[np.ndarray, "3"], arc: float) -> tuple[np.ndarray, OutsideView]:
        """As `StillColon.at`."""
        displacement = self._displacement[index]
        self.surface.move(displacement)
        rings = Surface(self._rings.vertices(displacement), self._rings.faces)
        eye = self._colon.moved_at_rest(displacement, tip, arc, lambda rest: _inside(self._case, rest, arc))
        outside = OutsideView(rings, self._rotation, width=self._size[0], height=self._size[1], framed=self._framed)
        return eye, outside


def _inside(case: TabulatedColon, tip: Float[np.ndarray, "3"], arc: float) -> Float[np.ndarray, "3"]:
    """Where the lens would be, had the wall not given way."""
    places = case.step * np.arange(len(case.points))
    return lens_inside(case.points, case.frames, places, case.sight, tip, arc)
