"""Where the links of a serial chain are, in JAX, for many worlds at once and without loops over links.

Places are sums along the chain, and a cumulative sum is one operation at any length. Only the rotations are multiplied,
in a prefix product.
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
    return Pose(rotation, origin)


def points_on(where: Pose, body: np.ndarray, local: Float[Any, "any points 3"]) -> Float[Array, "worlds points 3"]:
    """Positions of points that are fixed to bodies [m]; `local` has one row a world, or one row for all."""
    return where.origin[:, body] + _turned(where.rotation[:, body], local)


def _turned(rotation: Array, vectors: Array) -> Array:
    """Vectors (any, n, 3) of frames turned by (worlds, n, 3, 3), in the frames' surroundings."""
    return (rotation @ jnp.asarray(vectors, rotation.dtype)[..., None])[..., 0]


def _rotation(axis: Array, angle: Array) -> Array:
    """Rodrigues' formula: (worlds, dofs, 3, 3)."""
    sine, versine = jnp.sin(angle)[..., None, None], 2 * jnp.sin(angle / 2)[..., None, None] ** 2
    cross = _skew(axis)
    return jnp.eye(3, dtype=angle.dtype) + sine * cross + versine * (cross @ cross)


def _skew(vector: Array) -> Array:
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    zero = jnp.zeros_like(x)
    return jnp.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*vector.shape, 3)
