"""The dynamics of a serial chain in JAX, for many worlds at once: what MuJoCo computes link by link, without loops.

MJX walks a scope link by link, a kernel or more for each of six passes; compiling sixty of them takes minutes, running
them costs their launches. A chain needs no walk: in coordinates of one fixed point, velocities are sums along the chain
and composite inertias are sums from its end, and a cumulative sum is one operation at any length. Only the rotations
are multiplied, in a prefix product. The result is MuJoCo's mass matrix and bias to rounding (tests/envs/engine).

Spatial vectors are (angular, linear at the origin); see Featherstone 2008, chapters 2 and 5.
"""

from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from haustra.envs.sim.serial_chain import Chain, Links

Array: TypeAlias = Any


class Pose(NamedTuple):
    """Where a chain's links are; leading axis: worlds."""

    rotation: Array
    """(worlds, bodies, 3, 3)."""
    origin: Array
    """(worlds, bodies, 3) [m]."""
    screw: Array
    """(worlds, dofs, 6): velocity of what lies beyond a dof, per speed of that dof."""


def pose(chain: Chain, own: Links, qpos: Float[Array, "worlds dofs"]) -> Pose:
    """Forward kinematics."""
    kind = qpos.dtype
    axis = jnp.asarray(chain.axis, kind)
    local = jnp.asarray(chain.turn, kind) @ _rotation(axis, jnp.where(chain.hinge, qpos, 0))
    total = jax.lax.associative_scan(jnp.matmul, local, axis=1)
    rotation = total[:, chain.last_dof]
    direction = jnp.einsum("wdij,dj->wdi", total, axis)
    behind = jnp.concatenate([jnp.broadcast_to(jnp.eye(3, dtype=kind), (len(qpos), 1, 3, 3)), rotation[:, :-1]], axis=1)
    moves = _turned(behind, own.offset)
    slides = np.flatnonzero(~chain.hinge)
    for dof in slides:
        moves = moves.at[:, chain.body_of_dof[dof]].add(qpos[:, dof, None] * direction[:, dof])
    origin = jnp.cumsum(moves, axis=1)
    turning = jnp.asarray(chain.hinge, kind)[:, None] * direction
    linear = jnp.cross(origin[:, chain.body_of_dof], turning)
    linear = jnp.where(jnp.asarray(chain.hinge)[:, None], linear, direction)
    return Pose(rotation, origin, jnp.concatenate([turning, linear], axis=-1))


def points_on(where: Pose, body: np.ndarray, local: Float[Any, "any points 3"]) -> Float[Array, "worlds points 3"]:
    """Positions of points that are fixed to bodies [m]; `local` has one row a world, or one row for all."""
    return where.origin[:, body] + _turned(where.rotation[:, body], local)


def velocities(chain: Chain, where: Pose, qvel: Float[Array, "worlds dofs"]) -> Float[Array, "worlds bodies 6"]:
    """Spatial velocity of each body."""
    return jnp.cumsum(where.screw * qvel[..., None], axis=1)[:, chain.last_dof]


def inertias(own: Links, where: Pose) -> Float[Array, "worlds bodies 6 6"]:
    """Spatial inertia of each body about the origin."""
    kind = where.origin.dtype
    centre = points_on(where, np.arange(own.mass.shape[1]), own.centre)
    mass = jnp.asarray(own.mass, kind)[..., None, None]
    turned = where.rotation @ jnp.asarray(own.inertia, kind) @ jnp.swapaxes(where.rotation, -1, -2)
    side = mass * _skew(centre)
    top = jnp.concatenate([turned - side @ _skew(centre), side], axis=-1)
    bottom = jnp.concatenate([-side, jnp.broadcast_to(mass * jnp.eye(3, dtype=kind), side.shape)], axis=-1)
    return jnp.concatenate([top, bottom], axis=-2)


def point_inertia(points: Float[Array, "worlds points 3"], mass: Float[Array, "worlds points 3 3"]) -> Array:
    """Spatial inertia (worlds, points, 6, 6) of points whose 'mass' is a matrix: force = mass @ acceleration."""
    cross = _skew(points)
    corner = cross @ mass
    top = jnp.concatenate([-corner @ cross, corner], axis=-1)
    return jnp.concatenate([top, jnp.concatenate([-mass @ cross, mass], axis=-1)], axis=-2)


def wrench(points: Array, forces: Array) -> Float[Array, "worlds points 6"]:
    """Torque about the origin, and force, of forces [N] at points [m]."""
    return jnp.concatenate([jnp.cross(points, forces), forces], axis=-1)


def suffix_sum(per_body: Array) -> Array:
    """Sum over each body and all those beyond it."""
    return jnp.cumsum(per_body[:, ::-1], axis=1)[:, ::-1]


def mass_matrix(chain: Chain, where: Pose, composite: Float[Array, "worlds bodies 6 6"]) -> Array:
    """Joint-space inertia (worlds, dofs, dofs) of composite spatial inertias (`beyond`), which may hold other terms."""
    force = jnp.einsum("wdij,wdj->wdi", composite[:, chain.body_of_dof], where.screw)
    lower = jnp.tril(jnp.einsum("wdi,wei->wde", force, where.screw))
    return lower + jnp.swapaxes(jnp.tril(lower, -1), -1, -2)


def bias(
    chain: Chain, where: Pose, inertia: Array, qvel: Array, gravity: Float[Array, "any 3"]
) -> Float[Array, "worlds bodies 6"]:
    """Wrench on each body that its present velocity and gravity [m/s^2] need, at zero joint acceleration."""
    moving = where.screw * qvel[..., None]
    speed = jnp.cumsum(moving, axis=1)
    turning = jnp.cumsum(_motion_cross(speed, moving), axis=1)[:, chain.last_dof]
    velocity = speed[:, chain.last_dof]
    fall = jnp.concatenate([jnp.zeros_like(gravity), -gravity], axis=-1).astype(qvel.dtype)[:, None]
    momentum = jnp.einsum("wbij,wbj->wbi", inertia, velocity)
    return jnp.einsum("wbij,wbj->wbi", inertia, turning + fall) + _force_cross(velocity, momentum)


def joint_forces(chain: Chain, where: Pose, composite: Float[Array, "worlds bodies 6"]) -> Array:
    """Generalised forces (worlds, dofs) of wrenches summed over what lies beyond (`beyond`)."""
    return jnp.einsum("wdi,wdi->wd", where.screw, composite[:, chain.body_of_dof])


def _turned(rotation: Array, vectors: Array) -> Array:
    """Vectors (any, n, 3) of frames turned by (worlds, n, 3, 3), in the frames' surroundings."""
    return (rotation @ jnp.asarray(vectors, rotation.dtype)[..., None])[..., 0]


def _motion_cross(first: Array, second: Array) -> Array:
    turn, shift = first[..., :3], first[..., 3:]
    return jnp.concatenate(
        [jnp.cross(turn, second[..., :3]), jnp.cross(turn, second[..., 3:]) + jnp.cross(shift, second[..., :3])],
        axis=-1,
    )


def _force_cross(motion: Array, force: Array) -> Array:
    turn, shift = motion[..., :3], motion[..., 3:]
    return jnp.concatenate(
        [jnp.cross(turn, force[..., :3]) + jnp.cross(shift, force[..., 3:]), jnp.cross(turn, force[..., 3:])], axis=-1
    )


def _rotation(axis: Array, angle: Array) -> Array:
    """Rodrigues' formula: (worlds, dofs, 3, 3)."""
    sine, versine = jnp.sin(angle)[..., None, None], 2 * jnp.sin(angle / 2)[..., None, None] ** 2
    cross = _skew(axis)
    return jnp.eye(3, dtype=angle.dtype) + sine * cross + versine * (cross @ cross)


def _skew(vector: Array) -> Array:
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    zero = jnp.zeros_like(x)
    return jnp.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*vector.shape, 3)
