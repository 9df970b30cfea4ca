"""Where a tangent plane stands for its sphere, so that MuJoCo's contact acts where the law says.

Laws are written for one plane with `haustra.models.wall.vectors`, as those of `moving_colon` are.
"""

from typing import Any, NamedTuple

from haustra.models.wall import vectors
from haustra.models.wall.vectors import Vector, add, cross, dot, minus, stacked, times, where


class PlanePose(NamedTuple):
    """A plane of a sphere."""

    position: Any
    """(..., 3) [m]."""
    turn: Any
    """(..., 4) quaternion."""
    margin: Any
    """(...) of the pair: how deep the sphere is in the wall [m]."""


def counted_depth(xp: Any, depth: Any, inwards: Vector, speed: Vector, ahead: Any) -> Any:
    """The pair's margin, from which MuJoCo's spring counts, of a sphere in a wall that moves at that speed [m].

    MuJoCo takes a mocap plane for one that stands still. The wall's speed along its normal v changes the force of
    spring and damper, K d + (c + h K) d', as if it were deeper by (c / K + h) v: `ahead` is c / K + h [s].
    """
    return where(xp, depth > 0, xp.maximum(depth + ahead * dot(inwards, speed), 0.0), 0.0)


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


PARTS = (counted_depth, plane_turn, as_plane_sees)
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


def moving_planes(xp: Any, planes: PlanePose, depth: Any, inwards: Any, speed: Any, ahead: Any) -> tuple[Any, Any]:
    """What a wall's speed (..., 3) [m/s] does to its planes: the pairs' margins [m], and speeds of their surfaces.

    The speed along the wall is what MuJoCo's friction sees, in the frame of each plane [m/s].

    Args:
        xp: numpy or jax.numpy.
        planes: as in a wall that stands still.
        depth: as for `plane_pose` [m].
        inwards: as for `plane_pose`.
        speed: of the wall there.
        ahead: c / K + h [s].
    """
    moving = vectors.of(speed)
    surface = as_plane_sees(planes.turn[..., 0], vectors.of(planes.turn[..., 1:]), moving)
    return counted_depth(xp, depth, vectors.of(inwards), moving, ahead), stacked(xp, surface)
