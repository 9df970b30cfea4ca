"""The surface of a colon that has moved, without triangles that have turned over.

Each cross-section goes along with the axis by itself. Where a bend at rest is sharper than its lumen is wide, sections
cross at rest already, and the wall between them belongs to none: as the bend closes or opens, triangles there may turn
over. The wall buckles instead: their corners go aside, each the least way, until every triangle that faced its axis at
rest faces it. Only what is drawn and saved is changed.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.wall import vectors
from haustra.models.wall.vectors import Vector, cross, dot, times

OPEN = 0.1
"""What a triangle spans as seen from its axis is brought to this share of that at rest [1]; engineering choice."""
STRIDE = 0.002
"""A corner moves at most so far at once [m]; engineering choice, less than a triangle's edge."""
LOOKS, ROUNDS = 200, 1000
"""How often all triangles are looked at, at most, and those that turned after each look: what one gains the next may
lose. Fifty rounds left one or two triangles of a sharp bend turned after 200 looks that 2 looks of a thousand turn."""


def facing_out(colon: Colon, arcs: Float[np.ndarray, " vertices"]) -> Bool[np.ndarray, " triangles"]:
    """Which triangles face away from the centreline beside them.

    Args:
        colon: where it is.
        arcs: arc length of each vertex [m].
    """
    return spans(_corners(colon, arcs)) > 0


def unfolded(rest: Colon, now: Colon, arcs: Float[np.ndarray, " vertices"]) -> Colon:
    """A colon that has moved, its triangles spread until none faces its axis the other way than at rest.

    Args:
        rest: the colon at rest.
        now: the same colon now.
        arcs: arc length of each vertex [m].
    """
    from haustra.models.wall.compiled import loops

    vertices, faces = now.lumen.vertices.copy(), now.lumen.faces
    least = OPEN * spans(_corners(rest, arcs))
    loops().unfold(faces, _beside(now, arcs)[None], least, LOOKS, ROUNDS, vertices[None])
    return replace(now, lumen=Surface(vertices, faces))


def span(a: Vector, b: Vector, c: Vector) -> Any:
    """Six times the volume between a triangle and its axis [m^3], positive where it faces away from there.

    Args:
        a: a corner, from the axis [m].
        b: the next, so that the surface's normal points away from the lumen.
        c: the last.
    """
    return dot(a, cross(b, c))


def aside(xp: Any, a: Vector, b: Vector, c: Vector, lacking: Any) -> tuple[Vector, Vector, Vector]:
    """The shortest ways of a triangle's corners to where it spans so much more [m^3], of `STRIDE` at most."""
    slopes = cross(b, c), cross(c, a), cross(a, b)
    squares = dot(slopes[0], slopes[0]), dot(slopes[1], slopes[1]), dot(slopes[2], slopes[2])
    by = lacking / (squares[0] + squares[1] + squares[2])
    by = by * xp.minimum(1.0, STRIDE / (by * xp.sqrt(xp.maximum(xp.maximum(squares[0], squares[1]), squares[2]))))
    return times(by, slopes[0]), times(by, slopes[1]), times(by, slopes[2])


PARTS = (span, aside)
"""What numba is to compile."""


def _corners(colon: Colon, arcs: np.ndarray) -> Float[np.ndarray, "triangles 3 3"]:
    """Corners of the triangles, from the centreline beside each."""
    return colon.lumen.vertices[colon.lumen.faces] - _beside(colon, arcs)[:, None]


def _beside(colon: Colon, arcs: np.ndarray) -> Float[np.ndarray, "triangles 3"]:
    line, at = colon.centreline, arcs[colon.lumen.faces].mean(axis=1)
    return np.column_stack([np.interp(at, line.arc, line.points[:, axis]) for axis in range(3)])


def spans(corners: Float[np.ndarray, "triangles 3 3"]) -> Float[np.ndarray, " triangles"]:
    """`span` of many triangles, by their corners from the axis beside each [m^3]."""
    return np.asarray(span(*(vectors.of(corners[:, corner]) for corner in range(3))))
