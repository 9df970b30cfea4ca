"""Where a tangent plane stands for its sphere, so that MuJoCo's contact acts where the law says."""

from typing import Any, NamedTuple


class PlanePose(NamedTuple):
    """A plane of a sphere."""

    position: Any
    """(..., 3) [m]."""
    turn: Any
    """(..., 4) quaternion."""
    margin: Any
    """(...) of the pair: how deep the sphere is in the wall [m]."""


def plane_pose(xp: Any, centres: Any, radius: Any, depth: Any, inwards: Any) -> PlanePose:
    """Pose of the plane next to each sphere.

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
    return PlanePose(centres - away[..., None] * inwards, turn_to(xp, inwards), xp.maximum(depth, 0.0))


def turn_to(xp: Any, normals: Any) -> Any:
    """Quaternions (..., 4) of the shortest turn from z to each unit normal (..., 3); half a turn about x for -z."""
    x, y, z = normals[..., 0], normals[..., 1], normals[..., 2]
    opposite = z < -1 + 1e-6
    turn = xp.stack([1 + z, xp.where(opposite, 1.0, -y), xp.where(opposite, 0.0, x), xp.zeros_like(x)], axis=-1)
    return turn / xp.linalg.norm(turn, axis=-1, keepdims=True)
