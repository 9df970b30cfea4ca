"""The scope as a picture shows it: a black tube with white marks every 10 cm, a bending section, a bright tip."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.view.picture.raster import vertex_normals
from haustra.models.anatomy.frames import arc_length, resample, rotation_minimising_frames

_STEP = 0.0015
"""Spacing of the rings [m]: a third of a mark's width."""
_AROUND = 24
_MARK_SPACING, _MARK_WIDTH = 0.10, 0.004
_BLACK, _WHITE = np.array([0.10, 0.11, 0.13]), np.array([0.95, 0.95, 0.93])
_BENDING, _TIP = np.array([0.20, 0.23, 0.28]), np.array([0.55, 0.60, 0.66])
_TIP_LENGTH = 0.010


@dataclass(frozen=True)
class Tube:
    """A coloured triangle surface."""

    vertices: Float[np.ndarray, "vertices 3"]
    """Positions [m]."""
    faces: Int[np.ndarray, "triangles 3"]
    """Vertex indices, counter-clockwise seen from outside."""
    normals: Float[np.ndarray, "vertices 3"]
    """Unit normals, outwards."""
    colours: Float[np.ndarray, "vertices 3"]
    """RGB, 0 to 1."""


def tube(points: Float[np.ndarray, "points 3"], radius: float, *, bending_length: float) -> Tube:
    """A round tube along `points` (anus to tip) [m], closed by a rounded tip.

    Marks count from the tip, as on a real scope, so that the mark at the anus reads the depth of insertion.
    """
    stations = resample(points, _STEP)
    frames = rotation_minimising_frames(stations)
    arc = arc_length(stations)
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rings = stations[:, None] + radius * np.einsum("kc,sac->ska", circle, frames[:, :, :2])
    cap_angle = np.linspace(0, np.pi / 2, 6)[1:]
    forward, across = 0.5 * radius * np.sin(cap_angle), radius * np.cos(cap_angle)
    flat = np.einsum("kc,ac->ka", circle, frames[-1, :, :2])
    cap = stations[-1] + forward[:, None, None] * frames[-1, :, 2] + across[:, None, None] * flat
    vertices = np.concatenate([rings, cap]).reshape(-1, 3)
    faces = _grid(len(stations) + len(cap))
    from_tip = np.concatenate([arc[-1] - arc, np.zeros(len(cap))])
    colours = np.repeat(_colours(from_tip, bending_length), _AROUND, axis=0)
    return Tube(vertices, faces, vertex_normals(vertices, faces), colours)


def _grid(rings: int) -> np.ndarray:
    ring, k = np.meshgrid(np.arange(rings - 1), np.arange(_AROUND), indexing="ij")
    here, beside = ring * _AROUND + k, ring * _AROUND + (k + 1) % _AROUND
    lower = np.stack([here, beside, beside + _AROUND], axis=-1)
    upper = np.stack([here, beside + _AROUND, here + _AROUND], axis=-1)
    return np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)])


def _colours(from_tip: np.ndarray, bending_length: float) -> np.ndarray:
    colours = np.tile(_BLACK, (len(from_tip), 1))
    beyond = np.abs((from_tip + _MARK_SPACING / 2) % _MARK_SPACING - _MARK_SPACING / 2)
    colours[(beyond < _MARK_WIDTH / 2) & (from_tip > _MARK_SPACING / 2)] = _WHITE
    colours[from_tip < bending_length] = _BENDING
    colours[from_tip < _TIP_LENGTH] = _TIP
    return colours
