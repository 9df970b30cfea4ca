"""The pressure-volume law of a segment of colon: sigmoidal, as measured with a barostat.

V = Vmax exp(-kappa p^-beta), the power exponential that Bharucha fitted to descending colons (Am J Physiol
Gastrointest Liver Physiol 2001); kappa is told by the pressure at which half of Vmax is reached, kappa = ln 2 p50^beta.
Almost nothing opens at low pressure, most of it about p50, and little more beyond. A segment keeps its length, so the
law of volumes is one of cross-sections too, and diameters go with the root.
"""

from math import e, log, pi
from typing import Any

from haustra.models.wall.vectors import where

MMHG = 133.322
"""Pascals in a millimetre of mercury."""
LEAST_PRESSURE = 1.0
"""Below this [Pa] the law is not asked: it is level there, at 1e-100 of Vmax and less."""
MOST_SHARE = 1 - 1e-9
"""Share of Vmax at which the law's inverse ends: beyond lies no finite pressure."""


def open_share(xp: Any, pressure: Any, *, half: Any, exponent: Any) -> Any:
    """Share of Vmax that a segment holds [1].

    Args:
        xp: numpy, jax.numpy, or what a program offers in their place.
        pressure: of the gas over the segment's surroundings [Pa]; below none it is closed.
        half: pressure at which half of Vmax is reached [Pa].
        exponent: beta [1].
    """
    held = xp.maximum(pressure, LEAST_PRESSURE)
    return where(xp, pressure > LEAST_PRESSURE, xp.exp(-log(2) * xp.exp(exponent * xp.log(half / held))), 0.0)


def pressure_of(xp: Any, share: Any, *, half: Any, exponent: Any) -> Any:
    """The inverse of `open_share`: pressure at which a segment holds this share of Vmax [Pa]."""
    inside = xp.minimum(xp.maximum(share, 1e-300), MOST_SHARE)
    return half * xp.exp((log(log(2)) - xp.log(-xp.log(inside))) / exponent)


def share_rate(xp: Any, pressure: Any, *, half: Any, exponent: Any) -> Any:
    """Derivative of `open_share` by pressure [1/Pa]: the compliance of a segment whose Vmax is one."""
    held = xp.maximum(pressure, LEAST_PRESSURE)
    steep = log(2) * exponent * xp.exp(exponent * xp.log(half / held)) / held
    return steep * open_share(xp, pressure, half=half, exponent=exponent)


def width_share(xp: Any, pressure: Any, *, full: Any, half: Any, exponent: Any) -> Any:
    """Diameter at a pressure over that at the pressure `full` [1]."""
    return xp.sqrt(
        open_share(xp, pressure, half=half, exponent=exponent) / open_share(xp, full, half=half, exponent=exponent)
    )


def tension_stiffness(xp: Any, tension: Any, radius: Any, contact: Any) -> Any:
    """Force per depth with which a taut wall resists a device that presses on it [N/m].

    A membrane of that tension held at distance R, pushed by a disc of radius a: k = 2 pi T / ln(R / a), here with R the
    lumen's radius, and ln(R / a) no less than one, where the device fills the lumen.
    """
    return 2 * pi * tension / xp.log(xp.maximum(radius / contact, e))


def wall_tension(pressure: Any, radius: Any) -> Any:
    """Tension of a tube's wall round its circumference, of length along it [N/m], by Laplace's law."""
    return pressure * radius
