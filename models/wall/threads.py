"""A shaft is threaded through a colon that moves: what the wall does to it between its spheres, and far off its axis.

Spheres meet the wall where they are looked up. On the inside of a bend, past its middle, the nearest place of the axis
is on either leg, so that neighbours may leave the bend both ways, and those that stand beside it are near to neither.
The wall on the inside of the bend lies against the shaft there, and goes along with it: a node of the axis that is
further from the shaft than the lumen is wide is drawn to it (`ring_force`), and the shaft to the node, where it is
nearest. That is the force of an energy of distances between nodes and straight pieces of shaft: it is across the shaft,
as of a ring that slides on it. It is none where spheres hold the colon, as they do in most runs.

Nor is a sphere, or the tip, looked up further beyond the sphere before it than the colon between them can be packed
(`threaded_arc`): a shaft that is pulled taut across a loop would else leave it, and stand in the wall of either leg as
in a hook, and a tip in a sharp bend would be beyond it before it is round.
"""

from typing import Any, NamedTuple

import numpy as np

from haustra.models.wall import vectors
from haustra.models.wall.loops import added, beside
from haustra.models.wall.vectors import Vector, cross, minus, norm, times

RING = 150.0
"""Stiffness with which a node is drawn to a shaft that has left its cross-section [N/m]; engineering choice: ten nodes
of a loop are as stiff as the wall."""
FURTHEST = 0.02
"""A node that is further out than this is drawn no harder [m]; engineering choice."""
INDENTED = 0.005
"""Nodes are drawn to a shaft whose axis stands further than this in the wall [m]; engineering choice: contacts of its
spheres press by more than ten newtons there."""

PACKED = 2.9
"""Most of the axis at rest that lies along a piece of shaft, over its length [1]; engineering choice: folds that lie
against each other, at 0.35 of their length. With 4, to which 32 N press them, what is packed between two spheres of a
bend folds up beside the shaft, and pinches it (docs/log/navigation.md)."""


def threaded_arc(xp: Any, arc: Any, upto: Any, apart: Any) -> Any:
    """Arc length at which a sphere or the tip of a shaft is looked up [m]: that nearest to it or one nearer the anus.

    Args:
        xp: numpy or jax.numpy.
        arc: of the axis next to it [m].
        upto: arc length of the sphere before it at the last look [m].
        apart: distance to that sphere [m].
    """
    return xp.minimum(arc, upto + PACKED * apart)


def lumen_radius(xp: Any, drag: Any, turn_drag: Any) -> Any:
    """Mean radius of the lumen at a node [m], by which its turning is damped (`haustra.models.wall.mesentery`)."""
    return xp.sqrt(turn_drag / drag)


def ring_force(xp: Any, node: Vector, before: Vector, after: Vector, radius: Any) -> tuple[Any, Vector, Vector]:
    """How far out a node is [m], the force on it [N], and the place of the shaft that bears as much the other way [m].

    Args:
        xp: numpy or jax.numpy.
        node: its place [m].
        before: middle of the sphere before it [m].
        after: of the sphere after it [m].
        radius: of the lumen there [m].
    """
    _, away = beside(xp, node, before, after)
    distance = norm(xp, away)
    out = xp.minimum(xp.maximum(distance - radius - INDENTED, 0.0), FURTHEST)
    return out, times(-RING * out / distance, away), minus(node, away)


class Drawn(NamedTuple):
    """What shafts and nodes do to each other between spheres, of all worlds."""

    force: Any
    """(worlds, nodes, 3) on each node [N]."""
    stiffness: Any
    """(worlds, nodes) bound of its slope [N/m]."""
    borne: Any
    """(worlds, spheres, 3) on each sphere [N]."""
    moment: Any
    """(worlds, spheres, 3) about it [N m]."""


def drawn(xp: Any, own: Any, pose: Any, points: Any, arcs: Any) -> Drawn:
    """Draw each node to the piece of shaft that ends in the first sphere beyond it.

    Args:
        xp: numpy or jax.numpy.
        own: `haustra.models.wall.mesentery.Mesentery` of each world.
        pose: of the nodes (worlds, nodes, 7).
        points: middles of the spheres, from the shaft's end to its tip (worlds, spheres, 3) [m].
        arcs: their arc lengths (worlds, spheres) [m].
    """
    world, count = np.arange(len(points))[:, None], pose.shape[1]
    along = own.spacing[:, None] * xp.arange(count)
    upto = xp.maximum.accumulate(xp.maximum(arcs, 0.0), axis=1)
    sphere = (upto[:, None, :] >= along[..., None]).argmax(axis=-1)  # the first also where there is none beyond
    last = xp.maximum(sphere - 1, 0)
    before, after = vectors.of(points[world, last]), vectors.of(points[world, sphere])
    counts = xp.where(sphere > 0, 1.0, 0.0)
    radius = lumen_radius(xp, own.drag, own.turn_drag)
    out, force, place = ring_force(xp, vectors.of(own.nodes + pose[..., :3]), before, after, radius)
    force = times(counts, force)
    moment = vectors.stacked(xp, cross(minus(place, after), force))
    on_nodes, none = vectors.stacked(xp, force), xp.zeros_like(points)
    borne, turned = (added(xp, none, (world, sphere), -part) for part in (on_nodes, moment))
    return Drawn(on_nodes, xp.where(out > 0, RING * counts, 0.0), borne, turned)


def thread_energy(xp: Any, distance: Any, radius: Any) -> Any:
    """Energy of `ring_force` of a node at that distance from the shaft [J]."""
    out = xp.maximum(distance - radius - INDENTED, 0.0)
    near = xp.minimum(out, FURTHEST)
    return RING * near * (out - near / 2)


PARTS = (threaded_arc, lumen_radius, ring_force)
"""What numba is to compile."""
