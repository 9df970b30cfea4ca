"""A closed surface about an axis, from its radius on rings."""

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Surface

DOME_HEIGHT = 0.9
"""Height of a rounded end over its mean radius."""
DOME_RINGS = 5
"""Rings of each rounded end."""
RESOLUTION = 1e-6
"""Vertices are rounded to this [m], so that the last bits of sine and cosine on another machine do not show."""


def tube(
    points: Float[np.ndarray, "rings 3"],
    frames: Float[np.ndarray, "rings 3 3"],
    radius: Float[np.ndarray, "rings angles"],
) -> Surface:
    """Sweep rings along an axis and close both ends by half ellipsoids.

    Args:
        points: Centres of the rings [m].
        frames: Columns are first normal, second normal, tangent.
        radius: Radius [m] at angle 2*pi*k/angles from the first normal towards the second.
    """
    rise = np.linspace(0, np.pi / 2, DOME_RINGS + 1)[1:]
    first = [_dome(points[0], frames[0], radius[0], angle, -1) for angle in rise[::-1]]
    last = [_dome(points[-1], frames[-1], radius[-1], angle, 1) for angle in rise]
    body = [_ring(p, f, r) for p, f, r in zip(points, frames, radius, strict=True)]
    rings = np.stack([*first[1:], *body, *last[:-1]])
    poles = np.stack([first[0].mean(0), last[-1].mean(0)])
    vertices = np.concatenate([rings.reshape(-1, 3), poles])
    return Surface(vertices=np.round(vertices / RESOLUTION) * RESOLUTION + 0.0, faces=_faces(*rings.shape[:2]))


def _ring(point: np.ndarray, frame: np.ndarray, radius: np.ndarray) -> np.ndarray:
    turn = 2 * np.pi * np.arange(len(radius)) / len(radius)
    plane = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    return point + plane @ frame[:, :2].T


def _dome(point: np.ndarray, frame: np.ndarray, radius: np.ndarray, angle: float, sign: int) -> np.ndarray:
    height = sign * DOME_HEIGHT * float(radius.mean()) * np.sin(angle)
    return _ring(point + height * frame[:, 2], frame, radius * np.cos(angle))


def _faces(rings: int, angles: int) -> np.ndarray:
    """Two triangles a cell, wound outwards when the frame is right-handed, and a fan at each pole."""
    ring, k = np.meshgrid(np.arange(rings - 1), np.arange(angles), indexing="ij")
    a, b = (ring * angles + k).ravel(), (ring * angles + (k + 1) % angles).ravel()
    c, d = a + angles, b + angles
    start, end = rings * angles, rings * angles + 1
    k = np.arange(angles)
    following, top = (k + 1) % angles, (rings - 1) * angles
    return np.concatenate(
        [
            np.stack([a, b, d], axis=1),
            np.stack([a, d, c], axis=1),
            np.stack([following, k, np.full(angles, start)], axis=1),
            np.stack([top + k, top + following, np.full(angles, end)], axis=1),
        ]
    )
