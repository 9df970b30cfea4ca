"""Loops of colon that touch each other: each node is pressed away from the nearest part of another loop.

A node's partner is the nearest node that is so far from it along the colon that no gathering brings them together; the
node is pressed away from the axis beside that: the two edges that meet there. Both sides of a contact do so, each
with half of the stiffness of two walls in series. What lay against each other at rest is as thick as it was there, so
that a colon at rest is in balance. Partners are looked for anew before any two nodes can have come nearer by `STALE`,
so that loops never miss each other; in between, forces are those of an energy, and opposite and equal.
"""

from typing import Any

import numpy as np
from jaxtyping import Float, Int

from haustra.models.wall import vectors
from haustra.models.wall.sections import SHORTEST
from haustra.models.wall.vectors import TINY, Vector, dot, minus, norm, times, where

FLAT = 0.5
"""Loops whose axes are nearer than this share of the way at which they touch [1] are pressed flat on what is in them,
and bear like folds that are packed (`haustra.models.wall.moving_colon.edge_tension`); engineering choice."""
MARGIN = 0.01
"""Room across which partners are looked for [m]: the length of an edge; engineering choice."""
STALE = 5e-4
"""By how much loops may have come nearer since partners were looked for, before they are looked for anew [m];
engineering choice: loops come to rest by which part of each other they touch now, not by which they touched first."""


def nearness(there: Vector, here: Vector, kept: Any) -> Any:
    """How far spheres are from each other that touch at a distance [m^2]: the least is a node's partner."""
    away = minus(here, there)
    return dot(away, away) - kept * kept


def apart(nodes: Any, spacing: Any, kept: Any) -> Any:
    """Whether two nodes are so far from each other along the colon that only a loop brings them to where they touch.

    On a straight axis that is as short as it gets they just do not.

    Args:
        nodes: how many the one is behind the other.
        spacing: arc length between nodes [m].
        kept: distance at which they touch [m].
    """
    shortest = SHORTEST * spacing * nodes
    return shortest * shortest >= kept * kept


def beside(xp: Any, point: Vector, start: Vector, end: Vector) -> tuple[Any, Vector]:
    """Where on an edge a point is nearest to it, as a share of its length [1], and the way from there [m]."""
    edge = minus(end, start)
    way = minus(point, start)
    share = xp.minimum(xp.maximum(dot(way, edge) / xp.maximum(dot(edge, edge), TINY), 0.0), 1.0)
    return share, minus(way, times(share, edge))


def touch_force(xp: Any, distance: Any, kept: Any, stiffness: Any) -> tuple[Any, Any]:
    """Force of a contact [N], and its slope [N/m].

    Args:
        xp: numpy or jax.numpy.
        distance: between the axes [m].
        kept: that at which they touch [m].
        stiffness: [N/m].
    """
    flat = FLAT * kept
    left = xp.minimum(distance / flat, 1.0)
    force = xp.maximum(kept - distance, 0.0) + flat / 3 * (1 / (left * left) - left)
    slope = where(xp, distance < kept, 1.0, 0.0) + where(xp, left < 1, (1 + 2 / (left * left * left)) / 3, 0.0)
    return stiffness * force, stiffness * slope


def nearer(fastest: Any, h: Any) -> Any:
    """By how much two nodes come nearer in a step at most [m], of which the fastest is so fast [m/s]."""
    return 2 * h * fastest


def touch_energy(xp: Any, distance: Any, kept: Any, stiffness: Any) -> Any:
    """Energy of `touch_force` [J]."""
    flat = FLAT * kept
    left = xp.minimum(distance / flat, 1.0)
    packed = flat * flat / 3 * (left * left / 2 + 1 / left - 1.5)
    return stiffness * (0.5 * xp.maximum(kept - distance, 0.0) ** 2 + packed)


def contact(xp: Any, point: Vector, before: Vector, middle: Vector, after: Vector) -> tuple[Vector, Any, Vector]:
    """What of a partner's axis is nearest to a node: shares of three nodes, the distance [m] and the way from there.

    Args:
        xp: numpy or jax.numpy.
        point: the node [m].
        before: node before the partner [m].
        middle: the partner [m].
        after: node after it [m].
    """
    share, away = beside(xp, point, before, middle)
    later, other = beside(xp, point, middle, after)
    first = dot(away, away) < dot(other, other)
    shares = (
        where(xp, first, 1 - share, 0.0),
        where(xp, first, share, 1 - later),
        where(xp, first, 0.0, later),
    )
    away = (
        where(xp, first, away[0], other[0]),
        where(xp, first, away[1], other[1]),
        where(xp, first, away[2], other[2]),
    )
    distance = norm(xp, away)
    return shares, distance, times(1 / distance, away)


PARTS = (nearness, apart, beside, touch_force, contact, nearer)
"""What numba is to compile."""


def girths(
    nodes: Float[np.ndarray, "nodes 3"], outer: Float[np.ndarray, " nodes"], spacing: float
) -> Float[np.ndarray, " nodes"]:
    """How thick the colon is at each node for others that touch it [m]: as `outer`, less where loops are near at rest.

    Args:
        nodes: places at rest [m].
        outer: from the axis to the outside of the wall [m].
        spacing: arc length between nodes [m].
    """
    number = np.arange(len(nodes))
    around = nodes[np.maximum(number - 1, 0)], nodes, nodes[np.minimum(number + 1, number[-1])]
    _, distance, _ = contact(np, vectors.of(nodes[:, None]), *(vectors.of(each) for each in around))
    girth, before = outer, np.zeros_like(outer)
    while (girth != before).any():
        before, kept = girth, girth[:, None] + girth
        share = np.where(apart(number[:, None] - number, spacing, kept), distance / kept, 1.0)
        girth = girth * np.minimum(1.0, np.minimum(share.min(axis=0), share.min(axis=1)))
    return girth


def partners(own: Any, pose: Float[np.ndarray, "worlds nodes _"]) -> Int[np.ndarray, "worlds nodes"]:
    """Partner of each node, or -1 where there is none near: every other node will do, with an edge on either side.

    Args:
        own: `haustra.models.wall.mesentery.Mesentery` of each world.
        pose: of the nodes.
    """
    number = np.arange(pose.shape[1])
    others, places = number[1::2], own.nodes + pose[..., :3]
    kept = own.girth[:, :, None] + own.girth[:, None, others]
    near = nearness(vectors.of(places[:, None, others]), vectors.of(places[:, :, None]), kept)
    near = np.where(apart(number[:, None] - others, own.spacing[:, None, None], kept), near, np.inf)
    found = near.argmin(axis=2)
    best, kept = (np.take_along_axis(part, found[..., None], axis=2)[..., 0] for part in (near, kept))
    return np.where(best < MARGIN * (2 * kept + MARGIN), others[found], -1)


def touching(xp: Any, own: Any, pose: Any, found: Int[np.ndarray, "worlds nodes"]) -> tuple[Any, Any, Any]:
    """Forces of loops on nodes (worlds, nodes, 3) [N], a bound of their slopes [N/m], and their energy [J].

    The bound is twice the contact's own slope at each node, by its share: a row of the matrix of slopes sums to that.

    Args:
        xp: numpy or jax.numpy.
        own: `haustra.models.wall.mesentery.Mesentery` of each world.
        pose: of the nodes (worlds, nodes, 7).
        found: `partners`.
    """
    places, world, last = own.nodes + pose[..., :3], np.arange(pose.shape[0])[:, None], pose.shape[1] - 1
    at = np.maximum(found, 0)
    three = np.maximum(at - 1, 0), at, np.minimum(at + 1, last)
    shares, distance, way = contact(xp, vectors.of(places), *(vectors.of(places[world, node]) for node in three))
    kept = xp.where(found >= 0, own.girth + own.girth[world, at], 1e-6)
    distance = xp.where(found >= 0, distance, 1.0)
    stiffness = own.touch[:, None] / 2
    force, slope = touch_force(xp, distance, kept, stiffness)
    forces = vectors.stacked(xp, times(force, way))
    total, bound = forces, 2 * slope
    for node, share in zip(three, shares, strict=True):
        total = added(xp, total, (world, node), -share[..., None] * forces)
        bound = added(xp, bound, (world, node), 2 * share * slope)
    return total, bound, touch_energy(xp, distance, kept, stiffness)


def added(xp: Any, total: Any, at: Any, values: Any) -> Any:
    """An array with values added at places of it, which may be the same."""
    if xp is not np:
        return total.at[at].add(values)
    total = total.copy()
    np.add.at(total, at, values)
    return total
