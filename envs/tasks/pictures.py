"""Pictures from the tip's camera: colour and depth by the renderer of `haustra.envs.view.picture`."""

import numpy as np
from jaxtyping import Float, Int, UInt8

from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.sight import RANGE, Sight, in_bytes
from haustra.envs.view.picture.appearance import Appearance, Residue
from haustra.envs.view.picture.endoscope import Endoscope
from haustra.envs.view.picture.lens import lens_of
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.picture.surface import ColonSurface, MovingSurface
from haustra.models.wall.lumen_table import stack

Eye = tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]
"""Place of the camera [m], and columns: wire 'up', wire 'left', viewing direction."""


class Pictures:
    """Draws what is before a tip."""

    def __init__(
        self, bank: ColonSet, sight: Sight, field_of_view_deg: float, *, residue: Residue | None = None
    ) -> None:
        """Surfaces are made when a case is first looked at; `residue` is what lies on walls."""
        self._bank, self._sight, self._residue = bank, sight, residue
        self.view = min(field_of_view_deg, 170.0)
        """Full angle over the diameter of a depth picture [degrees]."""
        self._scopes: dict[tuple[int, int], tuple[Endoscope, ColonSurface]] = {}

    def colour(
        self, case: int, eye: Eye, arc: float, size: int, displacement: Float[np.ndarray, "nodes 7"] | None = None
    ) -> UInt8[np.ndarray, "size size 3"]:
        """A picture through the lens of the bank's design; wire 'up' is up.

        Args:
            case: which colon.
            eye: of the camera.
            arc: arc length beside it [m].
            size: rows and columns.
            displacement: poses of the nodes of a colon that moves.
        """
        scope, pose = self._looking(case, eye, arc, size, displacement)
        return scope.picture(pose)

    def depth(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        frame: Float[np.ndarray, "worlds 3 3"],
        arc: Float[np.ndarray, " worlds"],
        size: int,
    ) -> Float[np.ndarray, "worlds size size"]:
        """Distance to the wall in each pixel of equidistant pictures [m] of colons at rest; zero outside the circle."""
        return self._sight.depth(case, eye, frame, arc, field_of_view_deg=self.view, size=size)

    def both(
        self, case: int, eye: Eye, arc: float, size: int, displacement: Float[np.ndarray, "nodes 7"] | None = None
    ) -> UInt8[np.ndarray, "size size 4"]:
        """Colour, and the distance along the same rays over `RANGE` as a fourth channel; zero where all is black."""
        scope, pose = self._looking(case, eye, arc, size, displacement)
        view = scope.look(pose)
        distance = np.where(scope.renderer.lens.within, np.minimum(view.distance, RANGE), 0.0)
        return np.dstack([scope.develop(scope.radiance(view)), in_bytes(distance)])

    def _looking(
        self, case: int, eye: Eye, arc: float, size: int, displacement: Float[np.ndarray, "nodes 7"] | None
    ) -> tuple[Endoscope, CameraPose]:
        if (case, size) not in self._scopes:
            self._scopes[case, size] = self._scope(case, size, moves=displacement is not None)
        (scope, surface), (place, frame) = self._scopes[case, size], eye
        if displacement is not None:
            assert isinstance(surface, MovingSurface), "displacements of a colon that is fixed"
            surface.move(displacement)
        surface.make_room(place, frame[:, 2], arc, self._bank.design.diameter / 2)
        return scope, CameraPose.of_tip(place, frame)

    def _scope(self, case: int, size: int, *, moves: bool) -> tuple[Endoscope, ColonSurface]:
        tabulated = self._bank.cases[case]
        colon, lens = tabulated.colon(), lens_of(self._bank.design.tip, size, size)
        surface = (
            MovingSurface(colon, stack([tabulated.with_mesentery()]), *tabulated.own_axes)
            if moves
            else ColonSurface(colon)
        )
        looks = Appearance(colon, surface, residue=self._residue)
        return Endoscope(colon, lens, surface=surface, appearance=looks, threads=1), surface
