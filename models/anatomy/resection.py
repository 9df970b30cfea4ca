"""A colon whose polyp has been cut off, or bitten: tissue that is taken is gone from the surface and is lumen now."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidMeshError
from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.anatomy.lesion_shapes import cut_open, lesion_outline
from haustra.models.anatomy.lesion_surface import lesion_axis

_STEPS = 9
"""Corners of a quarter of a bite's circle."""


def resected(colon: Colon, lesion: int, *, margin: float, depth: float) -> Colon:
    """The colon without one polyp, a shallow wound in its place; radii and centreline stay.

    Args:
        colon: at rest.
        lesion: index of the polyp in the colon's lesions.
        margin: width of the rim of normal mucosa that goes along [m].
        depth: of the wound [m].

    Raises:
        InvalidMeshError: when cutting did not leave one closed surface.
    """
    polyp = colon.lesions[lesion]
    outline = lesion_outline(polyp)
    head = outline[2:]
    middle = np.array([0.0, polyp.extent - polyp.size / 2 if polyp.type == "pedunculated" else 0.0])
    away = (head - middle) / np.maximum(np.linalg.norm(head - middle, axis=1, keepdims=True), 1e-12)
    base = outline[1, 0] + margin
    around = np.vstack([[[0.0, -depth], [base, -depth]], head + margin * away])
    around[-1, 0] = 0.0
    rest = tuple(other for index, other in enumerate(colon.lesions) if index != lesion)
    return replace(_opened(colon, around, np.array(polyp.position), lesion_axis(colon, polyp)), lesions=rest)


def bitten(colon: Colon, lesion: int, *, size: float) -> Colon:
    """The colon with a ball of that diameter [m] bitten out of the top of one polyp.

    Raises:
        InvalidMeshError: when cutting did not leave one closed surface.
    """
    polyp = colon.lesions[lesion]
    quarter = np.linspace(-np.pi / 2, np.pi / 2, 2 * _STEPS - 1)
    ball = size / 2 * np.column_stack([np.cos(quarter), np.sin(quarter)])
    ball[[0, -1], 0] = 0.0
    axis = lesion_axis(colon, polyp)
    return _opened(colon, ball, np.array(polyp.position) + polyp.extent * axis, axis)


def _opened(colon: Colon, outline: np.ndarray, foot: np.ndarray, axis: Float[np.ndarray, "3"]) -> Colon:
    surface = cut_open(colon.lumen, outline, foot, axis)
    if surface is None:
        raise InvalidMeshError("Cutting did not leave one closed surface: the polyp lies too near to another wall.")
    return replace(colon, lumen=Surface(surface.vertices, surface.faces))
