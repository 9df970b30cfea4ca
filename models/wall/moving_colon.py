"""A colon that moves: where its wall is, what a device's contact does to it, and how it gives way.

Points are taken back into the colon at rest, looked up there, and what is found is turned into where the colon is now.
Forces on the device come back on the axis by the same map (its transpose), so that virtual work agrees. The axis has no
mass: it creeps against its damping under springs and contact, by backward Euler with a bound of the springs' stiffness
that is the same in all directions, one tridiagonal system a world. Contact damping and friction are in it too.

Laws are written for one node, edge or point with `haustra.models.wall.vectors`: arrays of them are stepped here, in
numpy and JAX, and in compiled loops by `haustra.models.wall.compiled`.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from haustra.models.wall import lumen_table as table
from haustra.models.wall import vectors
from haustra.models.wall.lumen_table import Tables, WallQuery
from haustra.models.wall.mesentery import Mesentery
from haustra.models.wall.vectors import Vector, add, between, cross, dot, minus, norm, stacked, times, unit_rate, where

Array: TypeAlias = Any

SHORTEST, SHORTEST_STIFFNESS = 0.35, 2000.0
"""A stretch that is pleated to less than this share of its length at rest [1] resists by this more [N]: folds of wall
lie against each other; engineering choice."""
_LEAST_COSINE = 0.01
"""A cross-section that is turned all the way round knows no shortest way back [1]; a colon does not do that."""


class AxisDisplacement(NamedTuple):
    """Where the axes are; leading axis: worlds."""

    place: Array
    """(worlds, nodes, 3) displacement from rest [m]."""
    speed: Array
    """(worlds, nodes, 3) [m/s]."""


class AxisShape(NamedTuple):
    """How axes lie, and how their cross-sections are turned from rest; leading axis: worlds."""

    units: Array
    """(worlds, nodes - 1, 3) directions of the edges."""
    lengths: Array
    """(worlds, nodes - 1) of the edges [m]."""
    tangents: Array
    """(worlds, nodes, 3) directions of the axis."""
    sums: Array
    """(worlds, nodes) lengths of the sums of neighbouring edges' directions."""
    cosines: Array
    """(worlds, nodes) cosine of the turn."""
    axes: Array
    """(worlds, nodes, 3) axis of the turn, as long as its sine."""


class AttachmentPoints(NamedTuple):
    """Where points hold on to the wall; leading axes: worlds, points."""

    arcs: Array
    """Arc length [m]."""
    lever: Array
    """(..., 3) from the axis to the point, in the colon at rest [m]."""


# Laws of one node, edge or point.


def turned(xp: Any, cosine: Any, axis: Vector, v: Vector) -> Vector:
    """A vector of a cross-section at rest, turned the shortest way that brings its tangent where it is now."""
    share = dot(axis, v) / xp.maximum(1 + cosine, _LEAST_COSINE)
    return add(add(times(cosine, v), cross(axis, v)), times(share, axis))


def turned_back(xp: Any, cosine: Any, axis: Vector, v: Vector) -> Vector:
    """The transpose of `turned`."""
    return turned(xp, cosine, times(-1.0, axis), v)


def turn_rate(xp: Any, cosine: Any, axis: Vector, cosine_rate: Any, axis_rate: Vector, v: Vector) -> Vector:
    """Rate of `turned` of a vector that itself does not change."""
    along, most = dot(axis, v), xp.maximum(1 + cosine, _LEAST_COSINE)
    rate = where(xp, 1 + cosine > _LEAST_COSINE, cosine_rate, 0.0)
    share = (dot(axis_rate, v) - along * rate / most) / most
    moved = add(times(cosine_rate, v), cross(axis_rate, v))
    return add(moved, add(times(along / most, axis_rate), times(share, axis)))


def turn_gradient(xp: Any, rest: Vector, cosine: Any, axis: Vector, couples: tuple[Vector, Vector, Vector]) -> Vector:
    """Gradient over the tangent of the work of forces f on vectors v of a cross-section: the transpose of `turn_rate`.

    Args:
        xp: numpy or jax.numpy.
        rest: tangent at rest.
        cosine: of the turn.
        axis: of the turn.
        couples: rows of the sum of f v^T [N m].
    """
    most = xp.maximum(1 + cosine, _LEAST_COSINE)
    first, second, third = couples
    onto = dot(first, axis), dot(second, axis), dot(third, axis)
    from_axis = add(add(times(axis[0], first), times(axis[1], second)), times(axis[2], third))
    diagonal = first[0] + second[1] + third[2]
    over_cosine = diagonal - where(xp, 1 + cosine > _LEAST_COSINE, dot(axis, onto), 0.0) / most**2
    about = third[1] - second[2], first[2] - third[0], second[0] - first[1]
    over_axis = add(about, times(1 / most, add(onto, from_axis)))
    return add(times(over_cosine, rest), cross(over_axis, rest))


def taken_back(
    xp: Any,
    offset: Vector,
    stretch: Any,
    along: Vector,
    before: tuple[Any, Vector],
    after: tuple[Any, Vector],
    share: Any,
) -> Vector:
    """Where a point stands from its place on the axis at rest, given where it stands from the axis now [m].

    Args:
        xp: numpy or jax.numpy.
        offset: from the axis now [m].
        stretch: length of the edge there over that at rest [1].
        along: direction of the axis there at rest, of any length.
        before: cosine and axis of the turn of the node before.
        after: of the node after.
        share: of the way between the nodes [1].
    """
    back = between(turned_back(xp, *before, offset), turned_back(xp, *after, offset), share)
    shortened = 1 / xp.maximum(stretch, SHORTEST) - 1
    along = times(1 / norm(xp, along), along)
    return add(back, times(shortened * dot(back, along), along))


def edge_tension(xp: Any, length: Any, rest: Any, tension: Any, pleating: Any) -> Any:
    """Force in an edge [N], positive where it is stretched."""
    strain = length / rest - 1
    stiffness = where(xp, strain > 0, tension, tension * pleating)
    return stiffness * strain - SHORTEST_STIFFNESS * xp.maximum(SHORTEST - 1 - strain, 0.0)


def bend_gradient(xp: Any, change: Vector, rest: Any, bending: Any) -> Vector:
    """Gradient of the bending energy over the change of direction from one edge to the next [N m].

    Only how much it bends counts, not to which side: a tube that may turn about itself.
    """
    amount = norm(xp, change)
    return times(bending * (amount - rest) / amount, change)


def hold_force(xp: Any, place: Vector, slack: Any, hold: Any, support: Any) -> Vector:
    """Force of mesentery and surroundings on a node [N]."""
    moved = norm(xp, place)
    return times(-hold * xp.maximum(moved - slack, 0.0) / moved - support, place)


def node_resistance(
    xp: Any, place: Vector, slack: Any, hold: Any, support: Any, drag: Any, gripped: Any, h: Any
) -> Any:
    """What a step's speed meets at a node by itself: damping, and h times a bound of its springs [N s/m]."""
    return drag + gripped + h * (support + where(xp, dot(place, place) > slack**2, hold, 0.0))


def edge_resistance(xp: Any, tension: Any, before: Any, after: Any, length: Any, h: Any) -> Any:
    """What a step's speed difference meets between nodes [N s/m]: h times a bound of the springs along and across.

    Bending resists most from node to node, by four times its stiffness, `before` and `after`, over the spacing.
    """
    return h * (tension + 4 * xp.maximum(before, after) / length) / length


def node_cell(xp: Any, spacing: Any, nodes: Any, arc: Any) -> tuple[Any, Any]:
    """Node before an arc length, and the share of the way to the next, of that many nodes."""
    way = arc / spacing
    at = xp.int32(xp.floor(where(xp, way > 0, xp.minimum(way, nodes - 2), 0.0)))  # NaN: the first
    return at, xp.minimum(xp.maximum(way - at, 0.0), 1.0)


PARTS = (
    turned,
    turned_back,
    turn_rate,
    turn_gradient,
    taken_back,
    edge_tension,
    bend_gradient,
    hold_force,
    node_resistance,
    edge_resistance,
    node_cell,
)
"""What numba is to compile."""


# Arrays of them.


def at_rest(xp: Any, own: Mesentery, worlds: int, kind: Any) -> AxisDisplacement:
    """Nothing has moved."""
    zero = xp.zeros((worlds, own.nodes.shape[-2], 3), kind)
    return AxisDisplacement(zero, zero)


def query(
    xp: Any, tables: Tables, displacement: AxisDisplacement, points: Array, arcs: Array, radius: Array
) -> tuple[WallQuery, AttachmentPoints]:
    """As `haustra.models.wall.lumen_table.query`, in a colon that has moved: tables of one colon a world.

    Spheres of that radius a world [m] hold on to the wall with their surfaces.
    """
    own = _hung(tables)
    shape = shape_of(xp, own, displacement.place)
    rest = to_reference(xp, tables, displacement.place, shape, points, arcs)
    found = table.query(xp, tables, rest, arcs)
    surface = rest - radius[:, None, None] * found.inwards
    grip = AttachmentPoints(found.arcs, surface - table.axis_at(xp, tables, found.arcs))
    return found._replace(inwards=_unit(xp, _turned(xp, own, shape, found.arcs, found.inwards))), grip


def shape_of(xp: Any, own: Mesentery, place: Array) -> AxisShape:
    """How axes lie that are displaced by so much (worlds, nodes, 3) [m]."""
    nodes = own.nodes + place
    edges = vectors.of(nodes[:, 1:] - nodes[:, :-1])
    lengths = norm(xp, edges)
    units = stacked(xp, times(1 / lengths, edges))
    sums = vectors.of(_at_nodes(xp, units))
    tangents, rest = times(1 / norm(xp, sums), sums), vectors.of(own.tangents)
    return AxisShape(
        units=units,
        lengths=lengths,
        tangents=stacked(xp, tangents),
        sums=norm(xp, sums),
        cosines=dot(rest, tangents),
        axes=stacked(xp, cross(rest, tangents)),
    )


def to_reference(xp: Any, tables: Tables, place: Array, shape: AxisShape, points: Array, arcs: Array) -> Array:
    """Points near those arc lengths, as if the colon around them had not moved (worlds, points, 3) [m].

    Args:
        xp: numpy or jax.numpy.
        tables: of each world.
        place: displacement of the nodes [m].
        shape: `shape_of` them.
        points: [m].
        arcs: [m].
    """
    own = _hung(tables)
    axis = table.axis_at(xp, tables, arcs)
    at, share = _cell(xp, own, arcs)
    world = _worlds(at)
    back = taken_back(
        xp,
        vectors.of(points - axis - _between(place, at, share)),
        shape.lengths[world, at] / own.lengths[world, at],
        vectors.of(_between(own.tangents, at, share)),
        (shape.cosines[world, at], vectors.of(shape.axes[world, at])),
        (shape.cosines[world, at + 1], vectors.of(shape.axes[world, at + 1])),
        share,
    )
    return axis + stacked(xp, back)


def back_to_reference(xp: Any, tables: Tables, place: Array) -> Callable[[Array, Array], Array]:
    """`to_reference` with displacements of the nodes [m], of points and arc lengths."""
    shape = shape_of(xp, _hung(tables), place)
    return lambda points, arcs: to_reference(xp, tables, place, shape, points, arcs)


def to_current(xp: Any, tables: Tables, place: Array, points: Array, arcs: Array) -> Array:
    """Points of the colon at rest at those arc lengths (worlds, points, 3), where they are now [m]."""
    return _current(xp, tables, place, shape_of(xp, _hung(tables), place), points, arcs)


def directions(xp: Any, own: Mesentery, place: Array, arcs: Array, v: Array) -> Array:
    """Directions in the colon at rest (worlds, points, 3), as they stand where it is now."""
    return _turned(xp, own, shape_of(xp, own, place), arcs, v)


def section_poses(
    xp: Any, tables: Tables, place: Array, shape: AxisShape, points: Array, arcs: Array
) -> tuple[Array, Array]:
    """Where bodies are that go along with cross-sections at arc lengths, and how they are turned from rest.

    Args:
        xp: numpy or jax.numpy.
        tables: of each world.
        place: displacement of the nodes [m].
        shape: `shape_of` them.
        points: where the bodies are at rest (worlds, points, 3) [m].
        arcs: [m].

    Returns:
        Points [m], and quaternions (worlds, points, 4).
    """
    own = _hung(tables)
    half = xp.concatenate([1 + shape.cosines[..., None], shape.axes], axis=-1)
    turn = _between(half / xp.linalg.norm(half, axis=-1, keepdims=True), *_cell(xp, own, arcs))
    turn = turn / xp.linalg.norm(turn, axis=-1, keepdims=True)
    return _current(xp, tables, place, shape, points, arcs), turn


def axis_at(xp: Any, tables: Tables, place: Array | None, arcs: Array) -> Array:
    """Points of the centreline at arc lengths, where it is now [m]; without displacements, where it is fixed."""
    still = table.axis_at(xp, tables, arcs)
    return still if place is None else still + _between(place, *_cell(xp, _hung(tables), arcs))


def wall_speeds(xp: Any, own: Mesentery, displacement: AxisDisplacement, grip: AttachmentPoints) -> Array:
    """Speeds of the wall where points hold on to it (worlds, points, 3) [m/s]; none before the anus."""
    shape = shape_of(xp, own, displacement.place)
    rates = vectors.of(displacement.speed[:, 1:] - displacement.speed[:, :-1])
    edges = stacked(xp, unit_rate(vectors.of(shape.units), shape.lengths, rates))
    tangents = unit_rate(vectors.of(shape.tangents), shape.sums, vectors.of(_at_nodes(xp, edges)))
    rest = vectors.of(own.tangents)
    cosines, axes = dot(rest, tangents), stacked(xp, cross(rest, tangents))
    at, share = _cell(xp, own, grip.arcs)
    world, lever = _worlds(at), vectors.of(grip.lever)

    def rate(node: Array) -> Vector:
        turn = shape.cosines[world, node], vectors.of(shape.axes[world, node])
        return turn_rate(xp, *turn, cosines[world, node], vectors.of(axes[world, node]), lever)

    turning = stacked(xp, between(rate(at), rate(at + 1), share))
    return xp.where((grip.arcs > 0)[..., None], _between(displacement.speed, at, share) + turning, 0.0)


def step_axis(
    xp: Any,
    own: Mesentery,
    displacement: AxisDisplacement,
    grip: AttachmentPoints,
    force: Array,
    damping: Array,
    h: Array,
) -> AxisDisplacement:
    """One time step.

    Args:
        xp: numpy or jax.numpy.
        own: of each world.
        displacement: where the axes are.
        grip: where the device holds on to the wall.
        force: on the wall there, at the end of the step as the device sees it (worlds, points, 3) [N].
        damping: of each contact, at least that in any direction (worlds, points) [N s/m].
        h: time step [s].
    """
    inside = grip.arcs > 0
    force, damping = xp.where(inside[..., None], force, 0.0), xp.where(inside, damping, 0.0)
    cell = _cell(xp, own, grip.arcs)
    couples = _onto_nodes(xp, own, cell, force[..., :, None] * grip.lever[..., None, :])
    gripped = _onto_nodes(xp, own, cell, damping)
    springs = spring_forces(xp, own, displacement.place, couples)
    pulled = _onto_nodes(xp, own, cell, force) + springs + gripped[..., None] * displacement.speed
    place = vectors.of(displacement.place)
    diagonal = node_resistance(xp, place, own.slack, own.hold, own.support, own.drag, gripped, h)
    tie = edge_resistance(xp, own.tension, own.bending[:, :-1], own.bending[:, 1:], own.lengths, h)
    below, above = xp.pad(tie, ((0, 0), (1, 0))), xp.pad(tie, ((0, 0), (0, 1)))
    speed = solve_tridiagonal(xp, -below, diagonal + below + above, -above, pulled)
    return AxisDisplacement(displacement.place + h * speed, speed)


def spring_forces(xp: Any, own: Mesentery, place: Array, couples: Array) -> Array:
    """Forces of the axis, its mesentery and what turns cross-sections on the nodes (worlds, nodes, 3) [N].

    Args:
        xp: numpy or jax.numpy.
        own: of each world.
        place: displacement of the nodes [m].
        couples: sums of f v^T of forces on vectors from each node's axis to the wall (worlds, nodes, 3, 3) [N m].
    """
    shape = shape_of(xp, own, place)
    rows = vectors.of(couples[..., 0, :]), vectors.of(couples[..., 1, :]), vectors.of(couples[..., 2, :])
    work = turn_gradient(xp, vectors.of(own.tangents), shape.cosines, vectors.of(shape.axes), rows)
    work = stacked(xp, unit_rate(vectors.of(shape.tangents), shape.sums, work))
    change = vectors.of(shape.units[:, 1:] - shape.units[:, :-1])
    bend = stacked(xp, bend_gradient(xp, change, own.turns[:, 1:-1], own.bending[:, 1:-1]))
    bend = xp.pad(bend, ((0, 0), (1, 1), (0, 0)))
    over_units = vectors.of(work[:, 1:] + work[:, :-1] + bend[:, 1:] - bend[:, :-1])
    units = vectors.of(shape.units)
    tension = edge_tension(xp, shape.lengths, own.lengths, own.tension, own.pleating[:, None])
    pull = stacked(xp, minus(times(tension, units), unit_rate(units, shape.lengths, over_units)))
    held = stacked(xp, hold_force(xp, vectors.of(place), own.slack, own.hold, own.support))
    return held + xp.pad(pull, ((0, 0), (0, 1), (0, 0))) - xp.pad(pull, ((0, 0), (1, 0), (0, 0)))


def solve_tridiagonal(xp: Any, below: Array, diagonal: Array, above: Array, right: Array) -> Array:
    """Solve diagonally dominant tridiagonal systems (worlds, nodes) for vectors (worlds, nodes, 3).

    By cyclic reduction in parallel (Hockney & Jesshope 1981): all worlds and nodes at once, in a few rounds. JAX's own
    solver goes through the worlds one by one on a GPU.
    """
    count = diagonal.shape[1]
    reach = 1
    while reach < count:
        back = -below / _shifted(xp, diagonal, reach, 1.0)
        forth = -above / _shifted(xp, diagonal, -reach, 1.0)
        diagonal = diagonal + back * _shifted(xp, above, reach) + forth * _shifted(xp, below, -reach)
        far = back[..., None] * _shifted(xp, right, reach) + forth[..., None] * _shifted(xp, right, -reach)
        right = right + far
        below, above = back * _shifted(xp, below, reach), forth * _shifted(xp, above, -reach)
        reach *= 2
    return right / diagonal[..., None]


def energy(xp: Any, own: Mesentery, place: Array) -> Array:
    """Stored in the axis and its mesentery (worlds,) [J]."""
    shape = shape_of(xp, own, place)
    strain = shape.lengths / own.lengths - 1
    tension = xp.where(strain > 0, own.tension, own.tension * own.pleating[:, None])
    along = 0.5 * tension * own.lengths * strain**2
    along = along + 0.5 * SHORTEST_STIFFNESS * own.lengths * xp.maximum(SHORTEST - 1 - strain, 0.0) ** 2
    change = norm(xp, vectors.of(shape.units[:, 1:] - shape.units[:, :-1]))
    bent = 0.5 * own.bending[:, 1:-1] * (change - own.turns[:, 1:-1]) ** 2
    moved = norm(xp, vectors.of(place))
    held = 0.5 * own.hold * xp.maximum(moved - own.slack, 0.0) ** 2 + 0.5 * own.support * moved**2
    return along.sum(axis=1) + bent.sum(axis=1) + held.sum(axis=1)


def _current(xp: Any, tables: Tables, place: Array, shape: AxisShape, points: Array, arcs: Array) -> Array:
    own, axis = _hung(tables), table.axis_at(xp, tables, arcs)
    moved = _between(place, *_cell(xp, own, arcs))
    return axis + moved + _turned(xp, own, shape, arcs, points - axis)


def _hung(tables: Tables) -> Mesentery:
    assert tables.mesentery is not None, "tables of a colon that is fixed in space"
    return tables.mesentery


def _turned(xp: Any, own: Mesentery, shape: AxisShape, arcs: Array, v: Array) -> Array:
    """Vectors of the colon at rest at those arc lengths (worlds, points, 3), turned."""
    at, share = _cell(xp, own, arcs)
    world, parts = _worlds(at), vectors.of(v)
    before, after = (
        turned(xp, shape.cosines[world, node], vectors.of(shape.axes[world, node]), parts) for node in (at, at + 1)
    )
    return stacked(xp, between(before, after, share))


def _cell(xp: Any, own: Mesentery, arcs: Array) -> tuple[Array, Array]:
    """Node before each arc length (worlds, points), and the share of the way to the next."""
    return node_cell(xp, own.spacing[:, None], own.nodes.shape[-2], arcs)


def _worlds(at: Array) -> Array:
    return np.arange(at.shape[0])[:, None]


def _between(values: Array, at: Array, share: Array) -> Array:
    """Values of the nodes (worlds, nodes, n) at places between them (worlds, points, n)."""
    world = _worlds(at)
    before, after = values[world, at], values[world, at + 1]
    return before + share[..., None] * (after - before)


def _onto_nodes(xp: Any, own: Mesentery, cell: tuple[Array, Array], values: Array) -> Array:
    """Shares of values at places between nodes (worlds, points, ...), summed over each node (worlds, nodes, ...)."""
    at, share = cell
    world = _worlds(at)
    zero = xp.zeros((at.shape[0], own.nodes.shape[-2], *values.shape[2:]), values.dtype)
    later = share.reshape(*share.shape, *[1] * (values.ndim - 2)) * values
    if xp is np:
        np.add.at(zero, (world, at), values - later)
        np.add.at(zero, (world, at + 1), later)
        return zero
    return zero.at[world, at].add(values - later).at[world, at + 1].add(later)


def _at_nodes(xp: Any, edges: Array) -> Array:
    """Sums of the vectors of neighbouring edges (worlds, nodes - 1, 3) at the nodes; at the ends, that of one edge."""
    return xp.concatenate([edges[:, :1], edges[:, 1:] + edges[:, :-1], edges[:, -1:]], axis=1)


def _unit(xp: Any, v: Array) -> Array:
    parts = vectors.of(v)
    return stacked(xp, times(1 / norm(xp, parts), parts))


def _shifted(xp: Any, values: Array, by: int, fill: float = 0.0) -> Array:
    """Values of the nodes `by` places before each, or that many after where it is negative; `fill` beyond the ends."""
    more = xp.full((values.shape[0], abs(by), *values.shape[2:]), fill, values.dtype)
    if by > 0:
        return xp.concatenate([more, values[:, :-by]], axis=1)
    return xp.concatenate([values[:, -by:], more], axis=1)
