"""A colon that moves, in JAX: where its wall is, what a scope's contact does to it, and how it gives way.

Points are taken back into the colon at rest, looked up there, and what is found is turned into where the colon is now.
Forces on the scope come back on the axis by the same map (its transpose), so that virtual work agrees. The axis has no
mass: it creeps against its damping under springs and contact, by backward Euler with a bound of the springs' stiffness
that is the same in all directions, one tridiagonal system a world. Contact damping and friction are in it too.
"""

from typing import Any, NamedTuple, TypeAlias

import jax
import jax.numpy as jnp

from haustra.models.wall import lumen_table as table
from haustra.models.wall.lumen_table import Tables, WallQuery
from haustra.models.wall.mesentery import Mesentery

Array: TypeAlias = Any

SHORTEST, SHORTEST_STIFFNESS = 0.35, 2000.0
"""A stretch that is pleated to less than this share of its length at rest [1] resists by this more [N]: folds of wall
lie against each other; engineering choice."""
_TINY = 1e-12


class AxisDisplacement(NamedTuple):
    """Where the axes are; leading axis: worlds."""

    place: Array
    """(worlds, nodes, 3) displacement from rest [m]."""
    speed: Array
    """(worlds, nodes, 3) [m/s]."""


class AttachmentPoints(NamedTuple):
    """Where points hold on to the wall; leading axes: worlds, points."""

    arcs: Array
    """Arc length [m]."""
    lever: Array
    """(..., 3) from the axis to the point, in the colon at rest [m]."""


def at_rest(own: Mesentery, worlds: int, kind: Any) -> AxisDisplacement:
    """Nothing has moved."""
    zero = jnp.zeros((worlds, own.nodes.shape[-2], 3), kind)
    return AxisDisplacement(zero, zero)


def touch(
    tables: Tables, shift: AxisDisplacement, points: Array, arcs: Array, radius: Array
) -> tuple[WallQuery, AttachmentPoints]:
    """As `haustra.models.wall.lumen_table.touch`, in a colon that has moved: tables of one colon a world.

    Spheres of that radius a world [m] hold on to the wall with their surfaces.
    """
    own = _hung(tables)
    frames = turns_of(own, shift.place)
    rest = to_reference(tables, shift.place, frames, points, arcs)
    found = table.touch(jnp, tables, rest, arcs)
    surface = rest - radius[:, None, None] * found.inwards
    grip = AttachmentPoints(found.arcs, surface - table.axis_at(jnp, tables, found.arcs))
    turned = jnp.einsum("wpij,wpj->wpi", _between(frames, *_cell(own, found.arcs)), found.inwards)
    return found._replace(inwards=_unit(turned)), grip


def turns_of(own: Mesentery, place: Array) -> Array:
    """Matrices that turn each node's cross-section from rest to where it is now (worlds, nodes, 3, 3)."""
    rest, now = own.tangents, _tangents(own.nodes + place)
    axis, cosine = jnp.cross(rest, now), _dot(rest, now)[..., None, None]
    # The shortest way. Turned all the way round, none is the shortest; a colon does not do that.
    across = axis[..., :, None] * axis[..., None, :] / jnp.maximum(1 + cosine, 0.01)
    return cosine * jnp.eye(3, dtype=place.dtype) + across + _crossing(axis)


def to_reference(tables: Tables, place: Array, frames: Array, points: Array, arcs: Array) -> Array:
    """Points near those arc lengths, as if the colon around them had not moved (worlds, points, 3) [m].

    Args:
        tables: of each world.
        place: displacement of the nodes [m].
        frames: `turns_of` them.
        points: [m].
        arcs: [m].
    """
    own = _hung(tables)
    axis = table.axis_at(jnp, tables, arcs)
    at, share = _cell(own, arcs)
    back = jnp.einsum("wpji,wpj->wpi", _between(frames, at, share), points - axis - _between(place, at, share))
    along = _unit(_between(own.tangents, at, share))
    stretch = jnp.take_along_axis(_lengths(own.nodes + place) / own.lengths, at, axis=1)
    shortened = 1 / jnp.maximum(stretch, SHORTEST) - 1
    return axis + back + (shortened * _dot(back, along))[..., None] * along


def turned(own: Mesentery, place: Array, arcs: Array, vectors: Array) -> Array:
    """Directions in the colon at rest (worlds, points, 3), as they stand where it is now."""
    return jnp.einsum("wpij,wpj->wpi", _between(turns_of(own, place), *_cell(own, arcs)), vectors)


def axis_at(tables: Tables, place: Array | None, arcs: Array) -> Array:
    """Points of the centreline at arc lengths, where it is now [m]; without displacements, where it is fixed."""
    still = table.axis_at(jnp, tables, arcs)
    return still if place is None else still + _between(place, *_cell(_hung(tables), arcs))


def to_current(tables: Tables, place: Array, points: Array, arcs: Array) -> Array:
    """Points of the colon at rest at those arc lengths (worlds, points, 3), where they are now [m]."""
    own = _hung(tables)
    axis = table.axis_at(jnp, tables, arcs)
    return axis + _held(own, (place, turns_of(own, place)), AttachmentPoints(arcs, points - axis))


def wall_speeds(own: Mesentery, shift: AxisDisplacement, grip: AttachmentPoints) -> Array:
    """Speeds of the wall where points hold on to it (worlds, points, 3) [m/s]; none before the anus."""
    rates = jax.jvp(lambda place: turns_of(own, place), (shift.place,), (shift.speed,))[1]
    return jnp.where((grip.arcs > 0)[..., None], _held(own, (shift.speed, rates), grip), 0.0)


def step_axis(
    own: Mesentery, shift: AxisDisplacement, grip: AttachmentPoints, force: Array, damping: Array, h: Array
) -> AxisDisplacement:
    """One time step.

    Args:
        own: of each world.
        shift: where the axes are.
        grip: where the scope holds on to the wall.
        force: on the wall there, at the end of the step as the scope sees it (worlds, points, 3) [N].
        damping: of each contact, at least that in any direction (worlds, points) [N s/m].
        h: time step [s].
    """
    inside = grip.arcs > 0
    force, damping = jnp.where(inside[..., None], force, 0.0), jnp.where(inside, damping, 0.0)
    cell = _cell(own, grip.arcs)
    couples = _onto_nodes(own, cell, force[..., :, None] * grip.lever[..., None, :])
    turning = jax.vjp(lambda place: turns_of(own, place), shift.place)[1](couples)[0]
    springs = jax.grad(lambda place: energy(own, place).sum())(shift.place)
    gripped = _onto_nodes(own, cell, damping)
    pulled = _onto_nodes(own, cell, force) + turning - springs + gripped[..., None] * shift.speed
    taut = _dot(shift.place, shift.place) > own.slack**2
    diagonal = own.drag + gripped + h * (own.support + jnp.where(taut, own.hold, 0.0))
    # Bending resists most from node to node, by four times its stiffness over the spacing.
    bend = jnp.maximum(own.bending[:, 1:], own.bending[:, :-1])
    tie = h * (own.tension + 4 * bend / own.lengths) / own.lengths
    below, above = jnp.pad(tie, ((0, 0), (1, 0))), jnp.pad(tie, ((0, 0), (0, 1)))
    speed = solve_tridiagonal(-below, diagonal + below + above, -above, pulled)
    return AxisDisplacement(shift.place + h * speed, speed)


def solve_tridiagonal(below: Array, diagonal: Array, above: Array, right: Array) -> Array:
    """Solve diagonally dominant tridiagonal systems (worlds, nodes) for vectors (worlds, nodes, 3).

    By cyclic reduction in parallel (Hockney & Jesshope 1981): all worlds and nodes at once, in a few rounds. JAX's own
    solver goes through the worlds one by one on a GPU.
    """
    count = diagonal.shape[1]
    reach = 1
    while reach < count:
        back = -below / _shifted(diagonal, reach, 1.0)
        forth = -above / _shifted(diagonal, -reach, 1.0)
        diagonal = diagonal + back * _shifted(above, reach) + forth * _shifted(below, -reach)
        far = back[..., None] * _shifted(right, reach) + forth[..., None] * _shifted(right, -reach)
        right = right + far
        below, above = back * _shifted(below, reach), forth * _shifted(above, -reach)
        reach *= 2
    return right / diagonal[..., None]


def _shifted(values: Array, by: int, fill: float = 0.0) -> Array:
    """Values of the nodes `by` places before each, or that many after where it is negative; `fill` beyond the ends."""
    more = jnp.full((values.shape[0], abs(by), *values.shape[2:]), fill, values.dtype)
    if by > 0:
        return jnp.concatenate([more, values[:, :-by]], axis=1)
    return jnp.concatenate([values[:, -by:], more], axis=1)


def energy(own: Mesentery, place: Array) -> Array:
    """Stored in the axis and its mesentery (worlds,) [J]."""
    nodes = own.nodes + place
    lengths = _lengths(nodes)
    stretch = lengths / own.lengths
    tension = jnp.where(stretch > 1, own.tension, own.tension * own.pleating[:, None])
    along = 0.5 * tension * own.lengths * (stretch - 1) ** 2
    along = along + 0.5 * SHORTEST_STIFFNESS * own.lengths * jnp.maximum(SHORTEST - stretch, 0.0) ** 2
    edges = (nodes[:, 1:] - nodes[:, :-1]) / lengths[..., None]
    # Only how much it bends counts, not to which side: a tube that may turn about itself.
    change = edges[:, 1:] - edges[:, :-1]
    excess = jnp.sqrt(_dot(change, change) + _TINY) - own.turns[:, 1:-1]
    bent = 0.5 * own.bending[:, 1:-1] * excess**2
    moved = jnp.sqrt(_dot(place, place) + _TINY)
    held = 0.5 * own.hold * jnp.maximum(moved - own.slack, 0.0) ** 2 + 0.5 * own.support * moved**2
    return along.sum(axis=1) + bent.sum(axis=1) + held.sum(axis=1)


def _hung(tables: Tables) -> Mesentery:
    assert tables.mesentery is not None, "tables of a colon that is fixed in space"
    return tables.mesentery


def _held(own: Mesentery, nodal: tuple[Array, Array], grip: AttachmentPoints) -> Array:
    """Where places of the wall are, less where their axis was at rest, given the nodes' shifts and turns; or rates."""
    place, turn = (_between(values, *_cell(own, grip.arcs)) for values in nodal)
    return place + jnp.einsum("wpij,wpj->wpi", turn, grip.lever)


def _cell(own: Mesentery, arcs: Array) -> tuple[Array, Array]:
    """Node before each arc length (worlds, points), and the share of the way to the next."""
    way = arcs / own.spacing[:, None]
    at = jnp.clip(jnp.floor(way), 0, own.nodes.shape[-2] - 2).astype(jnp.int32)
    return at, jnp.clip(way - at, 0.0, 1.0)


def _between(values: Array, at: Array, share: Array) -> Array:
    """Values of the nodes (worlds, nodes, ...) at places between them (worlds, points, ...)."""
    world = jnp.arange(at.shape[0])[:, None]
    before, after = values[world, at], values[world, at + 1]
    return before + share.reshape(*share.shape, *[1] * (values.ndim - 2)) * (after - before)


def _onto_nodes(own: Mesentery, cell: tuple[Array, Array], values: Array) -> Array:
    """Shares of values at places between nodes (worlds, points, ...), summed over each node (worlds, nodes, ...)."""
    at, share = cell
    world = jnp.arange(at.shape[0])[:, None]
    zero = jnp.zeros((at.shape[0], own.nodes.shape[-2], *values.shape[2:]), values.dtype)
    later = share.reshape(*share.shape, *[1] * (values.ndim - 2)) * values
    return zero.at[world, at].add(values - later).at[world, at + 1].add(later)


def _crossing(axis: Array) -> Array:
    """Matrices of the cross product with these vectors from the left."""
    x, y, z = axis[..., 0], axis[..., 1], axis[..., 2]
    zero = jnp.zeros_like(x)
    rows = [jnp.stack(row, axis=-1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return jnp.stack(rows, axis=-2)


def _tangents(nodes: Array) -> Array:
    """Directions of the axis at its nodes (worlds, nodes, 3)."""
    edges = nodes[:, 1:] - nodes[:, :-1]
    edges = edges / _lengths(nodes)[..., None]
    return _unit(jnp.concatenate([edges[:, :1], edges[:, 1:] + edges[:, :-1], edges[:, -1:]], axis=1))


def _lengths(nodes: Array) -> Array:
    edges = nodes[:, 1:] - nodes[:, :-1]
    return jnp.sqrt(_dot(edges, edges) + _TINY)


def _unit(vectors: Array) -> Array:
    return vectors / jnp.sqrt(_dot(vectors, vectors) + _TINY)[..., None]


def _dot(first: Array, second: Array) -> Array:
    return (first * second).sum(axis=-1)
