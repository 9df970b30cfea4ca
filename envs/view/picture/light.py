"""The light at an endoscope's tip, and what its camera makes of what comes back.

A light guide sends sigma exp(-mu (1 - cos)) / d^2 to a place at a distance d and an angle from its axis: the form, and
mu, are those of EndoMapper's photometric calibration. Gain is set anew for each picture, as cameras do, and brightness
is to the power of one over gamma.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8

_CURVE = 4096
"""Places of the table of a camera's curve."""


@dataclass(frozen=True)
class Light:
    """Light guides at a tip."""

    guides: tuple[tuple[float, float, float], ...] = (
        (3.24e-3, 0.55e-3, 0.0),
        (-2.77e-3, 2.66e-3, 0.0),
        (-1.27e-3, -3.14e-3, 0.0),
    )
    """Places in the camera's axes (right, up, backwards) [m]: the three guides of an Olympus CF-H190L, from the drawing
    that C3VD's renderer uses."""
    spread: float = 2.767
    """mu: how fast light falls with the angle from a guide's axis [1]; EndoMapper's example."""


@dataclass(frozen=True)
class Response:
    """What a camera makes of light."""

    gamma: float = 2.2
    """Brightness goes with light to the power of 1 / gamma [1]."""
    target: float = 0.45
    """Light that the automatic exposure gives the upper quarter of the picture, of the most that fits [1]; engineering
    choice."""
    gain: float | None = None
    """Fixed exposure [1]; automatic when None."""
    inertia: float = 0.0
    """Share of the last picture's gain that stays, in stops, for films [1]."""
    noise: float = 0.0
    """Standard deviation of the noise at full light, of the most that fits; it falls as the root of light [1]."""
    exposure: float = 0.0
    """Time for which a picture is exposed, for motion blur [s]; 0 for none."""

    def curve(self) -> UInt8[np.ndarray, " places"]:
        """Bytes for light from 0 to 1."""
        light = np.linspace(0.0, 1.0, _CURVE)
        bright = light ** (1 / self.gamma)
        return (255 * bright + 0.5).astype(np.uint8)

    def gain_for(self, radiance: Float[np.ndarray, "height width 3"], last: float | None = None) -> float:
        """Automatic gain: the upper middle of the picture's brightness goes to the target, or nowhere without light."""
        if self.gain is not None:
            return self.gain
        light = radiance[::4, ::4].max(axis=-1)
        lit = light[light > 0]
        if not len(lit):
            return 1.0 if last is None else last
        wanted = self.target / max(float(np.percentile(lit, 75)), 1e-12)
        return wanted if last is None else last**self.inertia * wanted ** (1 - self.inertia)

    def noisy(
        self, radiance: Float[np.ndarray, "height width 3"], gain: float, rng: np.random.Generator
    ) -> Float[np.ndarray, "height width 3"]:
        """Light with noise, which goes as the root of light."""
        drawn = rng.standard_normal(radiance.shape, dtype=np.float32)
        light = gain * radiance
        return np.maximum(light + self.noise * np.sqrt(np.maximum(light, 0.01)) * drawn, 0) / np.float32(gain)
