"""The wall as a device indents it: the surface that cameras see, and that is saved, has the device inside.

The wall gives way by force over stiffness, up to the device's own width, while the lumen's surface is that of a wall
nobody touches. Here each vertex near the device is moved out along its ray from the centreline until the device is
within, and what surrounds it goes along, on a slope: a tent, not a cliff. Only what is drawn and saved is changed.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.wall import vectors
from haustra.models.wall.vectors import Vector, cross, dot, minus, where

APART = 0.001
"""Distance between the places of the device's axis that are looked at [m]."""
GAP = 5e-4
"""The wall is drawn so far off the device [m]: flat triangles cut a round device's corners by 0.4 mm where their edges
are 4.5 mm long."""
SLOPE = 0.5
"""How steeply the indented wall rises beside the device [1]; engineering choice, so that no triangle turns over."""
TOP = float(np.sqrt(1 + SLOPE**2))
"""A tent over a ball stands so many of its radii over the ball's middle [1]."""
FALL = SLOPE / 2
"""A tent falls at least so steeply along the colon, on the inside of bends too [1]; engineering choice."""
NEAR = 0.01
"""Triangles are beside a place of the device that is at most so far along the colon [m]; engineering choice."""
JUMP_FREE = 0.005
"""A place of the device is beside a station at most so far from that of the place before it [m], or has jumped;
engineering choice, twice the distance of stations."""
JUMP_MOST = 0.2
"""No place is looked for further than this from the place before it [m]; engineering choice: more than loops that are
left out."""
JUMP_COST = 0.02
"""What a jump costs over its length, against squares of distances [m^2/m]: one of 0.1 m is worth five places that are
20 mm from the centreline; engineering choice."""


def indented(
    colon: Colon, arcs: Float[np.ndarray, " vertices"], path: Float[np.ndarray, "nodes 3"], *, radius: float
) -> Colon:
    """The colon, its surface moved out of a device's way.

    Args:
        colon: where it is now.
        arcs: arc length of each vertex of its surface [m].
        path: the device's axis past the anus, from there to the tip [m].
        radius: of the device [m].
    """
    from haustra.models.wall.compiled import loops

    if len(path) < 2:
        return colon
    line = colon.centreline
    places, found, high = along_device(path, line.points, line.arc, APART, radius + GAP)
    middles = np.column_stack([np.interp(arcs, line.arc, line.points[:, axis]) for axis in range(3)])
    vertices, at = colon.lumen.vertices.copy(), line.arc[found]
    loops().indent(places[None], at, high, arcs, middles[None], radius + GAP, 0, len(vertices), vertices[None])
    beside = line.points[found]
    loops().lift(colon.lumen.faces, arcs, places[None], at, beside[None], radius + GAP, vertices[None])
    return replace(colon, lumen=Surface(vertices, colon.lumen.faces))


def along_device(
    path: Float[np.ndarray, "nodes 3"],
    stations: Float[np.ndarray, "stations 3"],
    arcs: Float[np.ndarray, " stations"],
    apart: float,
    radius: float,
) -> tuple[Float[np.ndarray, "places 3"], Int[np.ndarray, " places"], Float[np.ndarray, " places"]]:
    """Places every `apart` [m] of a device's axis from the anus on [m], the station beside each, its tent's top [m].

    Where places jump over stations, one is said again for each of these.

    Args:
        path: the axis, two nodes or more [m].
        stations: the centreline [m].
        arcs: its arc lengths [m].
        apart: see there.
        radius: of the device [m].
    """
    from haustra.models.wall.compiled import loops

    line = np.ascontiguousarray(stations)[None]
    return loops().along(np.ascontiguousarray(path)[None], line, float(arcs[1] - arcs[0]), apart, radius)


def tops(
    places: Float[np.ndarray, "places 3"], beside: Float[np.ndarray, "places 3"], radius: float
) -> Float[np.ndarray, " places"]:
    """How far from the centreline the tents over places of a device stand at most [m].

    Args:
        places: of the device's axis [m].
        beside: of the centreline beside them [m].
        radius: of the device [m].
    """
    return top(np, vectors.of(places - beside), radius)


def top(xp: Any, away: Vector, radius: Any) -> Any:
    """How far from the centreline the tent over a place of a device stands at most [m].

    Args:
        xp: numpy or jax.numpy.
        away: from the centreline to the place [m].
        radius: of the device [m].
    """
    return xp.sqrt(dot(away, away)) + TOP * radius


def reached(xp: Any, away: Vector, ray: Vector, radius: Any) -> Any:
    """How far along a vertex's ray a place of the device pushes the wall [m]: as far as its ball, with a skirt.

    Where the ball falls off more steeply than `SLOPE`, a cone that touches it goes on.

    Args:
        xp: numpy or jax.numpy.
        away: from where the ray begins to the place [m].
        ray: its direction, a unit vector.
        radius: of the ball [m].
    """
    along = dot(away, ray)
    aside = xp.sqrt(xp.maximum(dot(away, away) - along * along, 0.0))
    ball = xp.sqrt(xp.maximum(radius * radius - aside * aside, 0.0))
    return along + where(xp, aside * TOP < SLOPE * radius, ball, TOP * radius - SLOPE * aside)


def crossed(ray: Vector, a: Vector, b: Vector, c: Vector) -> Any:
    """How far from the axis a ray from there crosses a triangle [m]; 0 where it does not (Moeller & Trumbore 1997).

    Args:
        ray: its direction, a unit vector.
        a: a corner, from where the ray begins [m].
        b: the next.
        c: the last.
    """
    one, other = minus(b, a), minus(c, a)
    normal = cross(one, other)
    facing, aside = dot(ray, normal), cross(a, ray)
    if facing == 0:
        return 0.0
    u, v = dot(other, aside) / facing, -dot(one, aside) / facing
    return dot(a, normal) / facing if u >= 0 and v >= 0 and u + v <= 1 else 0.0


PARTS = (top, reached, crossed)
"""What numba is to compile."""
