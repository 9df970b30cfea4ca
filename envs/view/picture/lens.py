"""Lenses of endoscopes: from pixels to rays and back, by two published models, for numpy and JAX.

A lens takes a ray at an angle from the axis to a radius in the picture. Scaramuzza's model (Scaramuzza et al. 2006) is
given as the ray of a radius: (u, v, z) with z a polynomial of the radius. Kannala and Brandt's (2006) is given as the
radius of an angle t: t + k0 t^3 + k1 t^5 + k2 t^7 + k3 t^9; with no coefficients it is the equidistant lens. Either is
turned round by a table and Newton's method. Pixels count from the middle of the first one; rays are unit vectors in
the camera's axes, MuJoCo's: right, up, backwards.
"""

import tomllib
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from haustra.assets import asset
from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.design import LENSES, ScopeTip

_TABLE = 4096
"""Places of a table by which a model is turned round."""
_WIDEST = np.radians(125.0)
"""No lens is looked through farther from its axis than this [rad]: half of 250 degrees."""
_EQUIDISTANT_DEG = 170.0
"""Full angle over the height of the equidistant lens's picture, unless another is asked for [degrees]."""


@dataclass(frozen=True)
class Lens:
    """One camera's lens at one size of its picture."""

    name: str
    """What a person calls it."""
    model: str
    """scaramuzza or kannala-brandt."""
    width: int
    """Columns of the picture [pixels]."""
    height: int
    """Rows of the picture [pixels]."""
    centre: tuple[float, float]
    """Where the axis meets the picture, column and row [pixels]; the first pixel's middle is 0."""
    stretch: tuple[tuple[float, float], tuple[float, float]]
    """From the model's plane, rightwards and downwards, to the picture [pixels]."""
    coefficients: tuple[float, ...]
    """Scaramuzza: a0 to a4 of z. Kannala and Brandt: k0 to k3."""
    field_of_view_deg: float
    """Full angle within which light comes in [degrees]; the rest of the picture is black."""
    corner: float = 0.0
    """Share of the shorter side that the black mask cuts off each corner [1]; 0 for none."""
    vignetting: float = 0.0
    """Brightness falls as this power of the cosine from the axis [1]."""
    source: str = ""
    """Who calibrated it, and what is assumed."""

    def rays(self, xp: Any, pixels: Float[Any, "*n 2"]) -> Float[Any, "*n 3"]:
        """Unit vectors (right, up, backwards) that pixels (column, row) see; NaN where none is."""
        plane = (pixels - xp.asarray(self.centre)) @ xp.asarray(np.linalg.inv(self.stretch).T)
        radius = xp.sqrt((plane**2).sum(axis=-1))
        angle = self.angle(xp, radius)
        aside = xp.sin(angle) / xp.maximum(radius, 1e-12)
        return xp.stack([aside * plane[..., 0], -aside * plane[..., 1], -xp.cos(angle)], axis=-1)

    def pixels(self, xp: Any, rays: Float[Any, "*n 3"]) -> Float[Any, "*n 2"]:
        """Column and row at which rays of any length (right, up, backwards) are seen; NaN where not."""
        off = xp.sqrt(rays[..., 0] ** 2 + rays[..., 1] ** 2)
        radius = self.radius(xp, xp.arctan2(off, -rays[..., 2])) / xp.maximum(off, 1e-12)
        plane = xp.stack([radius * rays[..., 0], -radius * rays[..., 1]], axis=-1)
        return plane @ xp.asarray(np.transpose(self.stretch)) + xp.asarray(self.centre)

    def angle(self, xp: Any, radius: Float[Any, "*n"]) -> Float[Any, "*n"]:
        """Angle from the axis [rad] that is seen at a radius in the model's plane."""
        inside = radius <= self._table[1][-1]
        if self.model == "scaramuzza":
            return xp.where(inside, xp.arctan2(radius, _polynomial(self.coefficients, radius)), np.nan)
        angle = xp.interp(radius, xp.asarray(self._table[1]), xp.asarray(self._table[0]))
        for _ in range(2):
            angle = angle - (self._of_angle(angle) - radius) / self._slope(angle)
        return xp.where(inside, angle, np.nan)

    def radius(self, xp: Any, angle: Float[Any, "*n"]) -> Float[Any, "*n"]:
        """Radius in the model's plane at which an angle from the axis [rad] is seen."""
        inside = angle <= self._table[0][-1]
        if self.model == "kannala-brandt":
            return xp.where(inside, self._of_angle(angle), np.nan)
        radius = xp.interp(angle, xp.asarray(self._table[0]), xp.asarray(self._table[1]))
        rising = tuple(power * each for power, each in enumerate(self.coefficients))[1:]
        for _ in range(2):  # along the ray of that angle: r cos = z(r) sin
            off = radius * xp.cos(angle) - _polynomial(self.coefficients, radius) * xp.sin(angle)
            radius = radius - off / (xp.cos(angle) - _polynomial(rising, radius) * xp.sin(angle))
        return xp.where(inside, radius, np.nan)

    @cached_property
    def grid(self) -> Float[np.ndarray, "height width 3"]:
        """Rays of all pixels; straight on where there are none."""
        columns, rows = np.meshgrid(np.arange(self.width), np.arange(self.height))
        rays = self.rays(np, np.stack([columns, rows], axis=-1).astype(float))
        return np.where(np.isfinite(rays), rays, (0.0, 0.0, -1.0))

    @cached_property
    def within(self) -> Bool[np.ndarray, "height width"]:
        """Which pixels show something: within the field of view, and not under the black mask."""
        columns, rows = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        rays = self.rays(np, np.stack([columns - 0.5, rows - 0.5], axis=-1))
        seen = -rays[..., 2] >= np.cos(np.radians(self.field_of_view_deg / 2))  # never of NaN
        aside = np.minimum(columns, self.width - columns) + np.minimum(rows, self.height - rows)
        return seen & (aside >= self.corner * min(self.width, self.height))

    def at(self, width: int, height: int) -> "Lens":
        """The lens with a picture of another size, which is filled: what is too wide or too high is cut off evenly."""
        scale = max(width / self.width, height / self.height)
        cut = ((scale * self.width - width) / 2, (scale * self.height - height) / 2)
        column, row = (scale * (place + 0.5) - 0.5 - less for place, less in zip(self.centre, cut, strict=True))
        (a, b), (c, d) = self.stretch
        stretch = ((scale * a, scale * b), (scale * c, scale * d))
        return replace(self, width=width, height=height, centre=(column, row), stretch=stretch)

    def _of_angle(self, angle: Any) -> Any:
        square = angle * angle
        return angle * (1 + square * _polynomial(self.coefficients, square))

    def _slope(self, angle: Any) -> Any:
        powers = tuple((2 * order + 3) * each for order, each in enumerate(self.coefficients))
        return 1 + angle * angle * _polynomial(powers, angle * angle)

    @cached_property
    def _table(self) -> tuple[np.ndarray, np.ndarray]:
        """Angles and radii, both rising, as far as the model is one-to-one."""
        if self.model == "kannala-brandt":
            angle = np.linspace(0.0, _WIDEST, _TABLE)
            radius = self._of_angle(angle)
        else:
            corner = np.linalg.norm([self.width, self.height]) / np.sqrt(abs(np.linalg.det(self.stretch)))
            radius = np.linspace(0.0, corner, _TABLE)
            angle = np.arctan2(radius, _polynomial(self.coefficients, radius))
        good = (np.diff(angle) > 0) & (np.diff(radius) > 0)
        end = len(good) if good.all() else int(np.argmin(good))
        return angle[: end + 1], radius[: end + 1]


def _polynomial(coefficients: tuple[float, ...], x: Any) -> Any:
    value = 0.0 * x
    for each in reversed(coefficients):
        value = value * x + each
    return value


def equidistant_lens(field_of_view_deg: float, size: int) -> Lens:
    """A lens without calibration in a square picture: angles from the axis are in proportion to radii.

    Args:
        field_of_view_deg: full angle over the diameter of the picture [degrees].
        size: rows and columns.
    """
    scale = size / np.radians(field_of_view_deg)
    return Lens(
        name="equidistant",
        model="kannala-brandt",
        width=size,
        height=size,
        centre=((size - 1) / 2, (size - 1) / 2),
        stretch=((scale, 0.0), (0.0, scale)),
        coefficients=(),
        field_of_view_deg=field_of_view_deg,
        source="no calibration: the simplest fisheye",
    )


def lens_of(tip: ScopeTip, width: int, height: int) -> Lens:
    """The lens of a tip at that size of the picture, dark beyond the tip's field of view."""
    if tip.lens == "equidistant":
        lens = equidistant_lens(min(tip.field_of_view_deg, 2 * np.degrees(_WIDEST)), 1080)
    else:
        lens = named_lens(tip.lens)
    return replace(lens, field_of_view_deg=min(tip.field_of_view_deg, lens.field_of_view_deg)).at(width, height)


@cache
def named_lens(name: str) -> Lens:
    """The shipped lens of that name, at the size of its calibration.

    Raises:
        InvalidOptionError: when there is none; the message lists those there are.
    """
    if name not in LENSES:
        raise InvalidOptionError(f"Lens '{name}' is not known. Known: {', '.join(LENSES)}.")
    if name == "equidistant":
        return equidistant_lens(_EQUIDISTANT_DEG, 1080)
    entries = tomllib.loads(asset(f"lenses/{name}.toml").read_text(encoding="utf-8"))
    entries["stretch"] = tuple(map(tuple, entries["stretch"]))
    held: dict[str, Any] = {key: tuple(each) if isinstance(each, list) else each for key, each in entries.items()}
    return Lens(**held)


@cache
def lens_rays(
    field_of_view_deg: float, size: int
) -> tuple[Float[np.ndarray, "size size 3"], Bool[np.ndarray, "size size"]]:
    """Unit vectors of an equidistant picture's pixels in the tip's frame, and which are within the lens.

    Args:
        field_of_view_deg: full angle over the diameter of the picture [degrees].
        size: rows and columns; wire 'up' is up.

    Returns:
        Vectors along wire 'up', wire 'left' and ahead; those of the rim beyond it.
    """
    grid = (np.arange(size) + 0.5) / size * 2 - 1
    right, up = np.meshgrid(grid, -grid)
    off = np.hypot(right, up)
    angle = np.minimum(off, 1.0) * np.radians(field_of_view_deg / 2)
    scale = np.sin(angle) / np.maximum(off, 1e-9)
    return np.stack([up * scale, -right * scale, np.cos(angle)], axis=-1), off <= 1


def camera_axes(frame: Float[np.ndarray, "*worlds 3 3"]) -> Float[np.ndarray, "*worlds 3 3"]:
    """Right, up and backwards of the camera, as columns, from those of its tip: wire 'up', wire 'left', ahead."""
    return np.stack([-frame[..., 1], frame[..., 0], -frame[..., 2]], axis=-1)
