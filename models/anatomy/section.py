"""Cross-sections of the lumen that share its volume out among the stations of the centreline."""

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Centreline

NEIGHBOURHOOD = 0.12
"""Stations within this arc length [m] on either side share the volume of a bend; others lie behind a wall."""


def section_radius(
    line: Centreline, radius: Float[np.ndarray, "stations angles"]
) -> Float[np.ndarray, "stations angles"]:
    """Radius [m] up to the wall, or up to where another station of the same bend is nearer.

    A ray that looks along a bend counts only as far as its own share of the lumen, which ends at the plane halfway
    to the other station: |d|^2 / (2 d.u) for a station at offset d and a ray along u.
    """
    angles = radius.shape[1]
    turn = 2 * np.pi * np.arange(angles) / angles
    rays = np.cos(turn)[:, None, None] * line.frames[:, :, 0] + np.sin(turn)[:, None, None] * line.frames[:, :, 1]
    rays = np.moveaxis(rays, 0, 1)
    reach = int(NEIGHBOURHOOD / float(line.arc[1]))
    limited = radius.copy()
    for shift in range(1, min(reach, len(radius) - 1) + 1):
        offset = line.points[shift:] - line.points[:-shift]
        half = 0.5 * (offset * offset).sum(1)[:, None]
        for own, sign in ((slice(None, -shift), 1.0), (slice(shift, None), -1.0)):
            ahead = sign * np.einsum("sai,si->sa", rays[own], offset)
            bound = np.where(ahead > 0, half / np.maximum(ahead, 1e-12), np.inf)
            limited[own] = np.minimum(limited[own], bound)
    return limited


def section_area(line: Centreline, radius: Float[np.ndarray, "stations angles"]) -> Float[np.ndarray, " stations"]:
    """Lumen volume per length of centreline [m^2].

    The volume element about a curve is (1 - r k.u) r dr dtheta ds, with k its curvature vector and u the ray.
    """
    angles = radius.shape[1]
    limited = section_radius(line, radius)
    turn = 2 * np.pi * np.arange(angles) / angles
    bend = np.gradient(line.frames[:, :, 2], line.arc, axis=0)
    along = np.einsum("si,sij->sj", bend, line.frames[:, :, :2]) @ np.stack([np.cos(turn), np.sin(turn)])
    share = limited**2 / 2 - along * limited**3 / 3
    return np.maximum(share, 0.0).sum(1) * 2 * np.pi / angles


def effective_diameter(
    line: Centreline, radius: Float[np.ndarray, "stations angles"]
) -> Float[np.ndarray, " stations"]:
    """Diameter of the circle with the lumen's volume per length, 2 sqrt(A/pi) [m]."""
    return 2 * np.sqrt(section_area(line, radius) / np.pi)
