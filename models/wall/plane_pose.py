"""Where a tangent plane stands for its sphere, so that MuJoCo's contact acts where the law says.

Laws are written for one plane with `haustra.models.wall.vectors`, as those of `moving_colon` are.
"""

from typing import Any, NamedTuple

from haustra.models.wall import vectors
from haustra.models.wall.vectors import Vector, add, cross, dot, minus, stacked, times, where

_TOUCHING = 5e-7
"""Margin where a wall gives way fast [m]: single precision still finds the contact, which presses by 1 mN."""
_STILL = 1e-9
"""Far less than any speed that counts [m/s]."""


class PlanePose(NamedTuple):
    """A plane of a sphere."""

    position: Any
    """(..., 3) [m]."""
    turn: Any
    """(..., 4) quaternion."""
    margin: Any
    """(...) of the pair: how deep the sphere is in the wall [m]."""


def moving_contact(xp: Any, depth: Any, inwards: Vector, speed: Vector, ahead: Any, timestep: Any) -> tuple[Any, Any]:
    """Spring and damper of MuJoCo's contact with a wall that moves: the pair's margin [m], and damper over K [s].

    MuJoCo takes a mocap plane for one that stands still. The wall's speed along its normal v changes the force on a
    sphere that leaves at v', F = K d - (c + h K) (v' - v), as if it were deeper by a v, where `ahead`, a, is c / K + h.
    No margin is negative. Where the wall gives way faster than d / a, a weaker damper takes its place, so that what
    goes along with the wall is pressed by K d, as by the law. Half a step of the spring is left, which keeps it stable.
    """
    retreat = -dot(inwards, speed)
    weaker = xp.minimum(xp.maximum(depth / xp.maximum(retreat, _STILL), timestep / 2), ahead)
    margin = xp.maximum(depth - weaker * retreat, xp.minimum(depth, _TOUCHING))
    return where(xp, depth > 0, margin, 0.0), where(xp, depth > 0, weaker, ahead)


def plane_turn(xp: Any, normal: Vector) -> tuple[Any, Vector]:
    """Quaternion, in two parts, of the shortest turn from z to a unit normal; half a turn about x for -z."""
    opposite = 1 + normal[2] < 1e-9
    cosine = where(xp, opposite, 0.0, 1 + normal[2])
    about = where(xp, opposite, 1.0, -normal[1]), where(xp, opposite, 0.0, normal[0]), 0.0 * normal[2]
    size = 1 / xp.sqrt(cosine * cosine + dot(about, about))
    return cosine * size, times(size, about)


def as_plane_sees(cosine: Any, about: Vector, v: Vector) -> Vector:
    """A vector in the frame of a plane that is turned so: MuJoCo's `geom_surfacevel` of a wall's speed."""
    side = cross(about, v)
    return add(v, times(2.0, minus(cross(about, side), times(cosine, side))))


PARTS = (moving_contact, plane_turn, as_plane_sees)
"""What numba is to compile."""


def plane_pose(xp: Any, centres: Any, radius: Any, depth: Any, inwards: Any) -> PlanePose:
    """Pose of the plane next to each sphere, in a wall that stands still.

    MuJoCo's contact acts half-way between both outlines, which is d/2 below the surface of a sphere that is d deep: on
    a shaft of 6 mm under 10 N, friction would have half its lever. So the plane is withdrawn until it only touches the
    sphere, as an indented wall does, and the depth is the pair's margin, which MuJoCo's spring counts from.

    Args:
        xp: numpy or jax.numpy.
        centres: of the spheres (..., 3) [m].
        radius: of the spheres [m].
        depth: how deep they are in the wall, negative away from it (...) [m].
        inwards: unit normals of the wall, into the lumen (..., 3).
    """
    away = radius + xp.maximum(-depth, 0.0)
    cosine, about = plane_turn(xp, vectors.of(inwards))
    turn = xp.stack([cosine, *about], axis=-1)
    return PlanePose(centres - away[..., None] * inwards, turn, xp.maximum(depth, 0.0))


def moving_planes(
    xp: Any, planes: PlanePose, depth: Any, inwards: Any, speed: Any, ahead: Any, timestep: Any
) -> tuple[Any, Any, Any]:
    """What a wall's speed (..., 3) [m/s] does to its planes: `moving_contact`, and speeds of their surfaces.

    The speed along the wall is what MuJoCo's friction sees, in the frame of each plane [m/s].

    Args:
        xp: numpy or jax.numpy.
        planes: as in a wall that stands still.
        depth: as for `plane_pose` [m].
        inwards: as for `plane_pose`.
        speed: of the wall there.
        ahead: c / K + h [s].
        timestep: h [s].
    """
    moving = vectors.of(speed)
    surface = as_plane_sees(planes.turn[..., 0], vectors.of(planes.turn[..., 1:]), moving)
    return *moving_contact(xp, depth, vectors.of(inwards), moving, ahead, timestep), stacked(xp, surface)
