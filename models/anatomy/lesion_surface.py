"""Which triangles of a colon's surface belong to its polyps and diverticula, by the shapes that were cut into it."""

import numpy as np
from jaxtyping import Float, Int

from haustra.models.anatomy.colon import Colon, Lesion
from haustra.models.anatomy.lesion_shapes import NECK_INSIDE, lesion_outline

NO_LESION = -1
"""Number of triangles that belong to none."""
_OFF, _SHARE_OFF = 1e-4, 0.01
"""A triangle's middle lies at most so far from a lesion's outline [m], and so much of its width more: shapes are cut as
prisms of 28 sides, whose faces lie within 0.7 % of the radius, and slivers beside a cut are collapsed."""


def lesion_of_triangles(colon: Colon) -> Int[np.ndarray, " triangles"]:
    """Index in `colon.lesions` of the polyp or diverticulum of each triangle, `NO_LESION` where there is none.

    Strictures have no border of their own and are left out. The colon is to be at rest, as its lesions' places are.
    """
    corners = colon.lumen.vertices[colon.lumen.faces]
    middles = corners.mean(axis=1)
    found = np.full(len(middles), NO_LESION)
    for index, lesion in enumerate(colon.lesions):
        if lesion.kind == "stricture":
            continue
        reach = lesion.extent + lesion.size + NECK_INSIDE
        near = np.flatnonzero(np.linalg.norm(middles - lesion.position, axis=1) < reach)
        off = _off_outline(_profile(middles[near], lesion, lesion_axis(colon, lesion)), lesion_outline(lesion))
        found[near[off < _OFF + _SHARE_OFF * lesion.size]] = index
    return found


def lesion_axis(colon: Colon, lesion: Lesion) -> Float[np.ndarray, "3"]:
    """Unit vector along which a polyp rises from its foot, or a diverticulum sinks from it."""
    assert lesion.angle is not None, "a stricture has no side"
    line = colon.centreline
    frame = line.frames[int(np.argmin(np.abs(line.arc - lesion.arc)))]
    outwards = frame[:, :2] @ np.array([np.cos(lesion.angle), np.sin(lesion.angle)])
    return -outwards if lesion.kind == "polyp" else outwards


def _profile(points: np.ndarray, lesion: Lesion, axis: np.ndarray) -> Float[np.ndarray, "points 2"]:
    """Distance from a lesion's axis, and height along it [m]."""
    away = points - lesion.position
    height = away @ axis
    return np.column_stack([np.linalg.norm(away - height[:, None] * axis, axis=1), height])


def _off_outline(places: np.ndarray, outline: Float[np.ndarray, "corners 2"]) -> Float[np.ndarray, " points"]:
    """Distance to the nearest stretch of an outline [m]; the first, across the axis below the foot, is no surface."""
    first, step = outline[1:-1], np.diff(outline, axis=0)[1:]
    away = places[:, None] - first
    along = np.clip((away * step).sum(-1) / np.maximum((step * step).sum(-1), 1e-18), 0.0, 1.0)
    return np.linalg.norm(away - along[..., None] * step, axis=-1).min(axis=1)
