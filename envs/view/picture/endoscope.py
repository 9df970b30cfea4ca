"""The endoscope's picture: what a tip's camera sees, lit by its own light, in colour."""

import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.view.picture import kernels
from haustra.envs.view.picture.appearance import Appearance
from haustra.envs.view.picture.lens import Lens
from haustra.envs.view.picture.light import Light, Response
from haustra.envs.view.picture.renderer import CameraPose, RayRenderer, SurfaceView
from haustra.envs.view.picture.shader import LANES, Shader
from haustra.envs.view.picture.surface import LumenSurface
from haustra.models.anatomy.colon import Colon
from haustra.models.wall.signed_distance import surface_arcs

_MOVES = 5
"""Places between two poses at which a picture with motion blur is taken."""


class Endoscope:
    """Camera and light at a tip in one colon."""

    def __init__(
        self,
        colon: Colon,
        lens: Lens,
        *,
        surface: LumenSurface | None = None,
        appearance: Appearance | None = None,
        light: Light | None = None,
        response: Response | None = None,
        threads: int | None = None,
        seed: int = 0,
    ) -> None:
        """Look into a colon.

        Args:
            colon: at rest.
            lens: at the size of the pictures.
            surface: of the colon, where it moves; it stands still when None.
            appearance: looks of its wall; made from the seed when None.
            light: at the tip; that of an Olympus CF-H190L when None.
            response: of the camera; automatic exposure without noise when None.
            threads: as many as there are cores when None.
            seed: of patterns and noise.
        """
        self.surface = surface or LumenSurface(colon.lumen, surface_arcs(colon))
        self.appearance = appearance or Appearance(colon, self.surface, seed=seed)
        self.renderer = RayRenderer(self.surface, lens, threads=threads)
        self._shader, self._response = Shader(lens, light or Light()), response or Response()
        self._curve = self._response.curve()
        self._gain: float | None = None
        self._random = np.random.default_rng(seed)

    def look(self, pose: CameraPose) -> SurfaceView:
        """What the rays of all pixels meet (`haustra.envs.view.picture.renderer`)."""
        return self.renderer.look(pose)

    def picture(self, pose: CameraPose, before: CameraPose | None = None) -> UInt8[np.ndarray, "height width 3"]:
        """The picture in colour; blurred by the way from `before`, where the camera was when exposure began."""
        return self.develop(self._blurred(pose, before) if before else self.radiance(self.look(pose)))

    def radiance(self, view: SurfaceView) -> Float[np.ndarray, "height width 3"]:
        """Light that comes back in each pixel, before exposure [in units of a guide's at 1 m]."""
        light = np.empty((3, *view.distance.shape), np.float32)
        self.renderer.each_block(LANES, self._shader.bind(self.appearance, view, light))
        return np.moveaxis(light, 0, -1)

    def develop(
        self, radiance: Float[np.ndarray, "height width 3"], *, seed: int | None = None
    ) -> UInt8[np.ndarray, "height width 3"]:
        """Expose light that came back, with noise of that seed, or that follows the last picture's."""
        random = self._random if seed is None else np.random.default_rng(seed)
        self._gain = gain = self._response.gain_for(radiance, self._gain)
        if self._response.noise > 0:
            noisy = self._response.noisy(radiance, gain, random)
            radiance = np.where(self.renderer.lens.within[..., None], noisy, radiance)  # the mask is no picture
        picture, light = np.empty(radiance.shape, np.uint8), np.ascontiguousarray(np.moveaxis(radiance, -1, 0))
        self.renderer.each_row(lambda first, last: kernels.develop(first, last, light, gain, self._curve, picture))
        return picture

    def _blurred(self, pose: CameraPose, before: CameraPose) -> Float[np.ndarray, "height width 3"]:
        total = np.zeros((self.renderer.lens.height, self.renderer.lens.width, 3), np.float32)
        for share in exposed_shares():
            total += self.radiance(self.look(before.towards(pose, share)))
        return total / _MOVES


def exposed_shares() -> list[float]:
    """Shares of the way through an exposure at which a picture with motion blur is taken [1]."""
    return ((np.arange(_MOVES) + 0.5) / _MOVES).tolist()
