"""A colon that moves: where its wall is, what a device's contact does to it, and how it gives way.

Points are taken back into the colon at rest, looked up there, and what is found is turned into where the colon is now.
Forces on the device come back on the axis by the same map (its transpose), so that virtual work agrees. The axis has no
mass: it creeps against its damping under springs and contact, by backward Euler with a bound of the springs' stiffness
that is the same in all directions, one tridiagonal system a world. Contact damping and friction are in it too.

How cross-sections go along with the axis stands in `haustra.models.wall.sections`. Laws are written for one node, edge
or point with `haustra.models.wall.vectors`: arrays of them are stepped here, in numpy and JAX, and in compiled loops by
`haustra.models.wall.compiled`.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from haustra.models.wall import lumen_table as table
from haustra.models.wall import vectors
from haustra.models.wall.loops import touching
from haustra.models.wall.lumen_table import Tables, WallQuery
from haustra.models.wall.mesentery import Mesentery
from haustra.models.wall.sections import (
    SHORTEST,
    STILL,
    Section,
    Turn,
    brought_along,
    carried,
    carried_rate,
    cell_closing,
    cell_closing_gradient,
    cell_closing_rate,
    cell_closing_reach,
    flattening,
    flattening_rate,
    flattening_reach,
    held_at,
    node_closing,
    node_closing_rate,
    section_gradient,
    taken_back,
    touched,
    turned,
    twist,
    twisted,
)
from haustra.models.wall.surroundings import breath, envelope_energy, envelope_force, hung
from haustra.models.wall.threads import Drawn, threaded_arc
from haustra.models.wall.vectors import Vector, add, between, cross, dot, minus, norm, stacked, times, unit_rate, where

Array: TypeAlias = Any

LEANS = 10.0
"""Most that friction counts for against the leaning of sections, over the force of a contact [s/m]: as where it slides
at 10 mm/s with a coefficient of 0.1; engineering choice: what still trembles does so by less than 0.05 mm a step."""

LEAST_FACING = 0.05
"""Edges that fold back on each other bend as if the sum of their directions were so long [1]: at 177 degrees."""

STACKED = 2 / SHORTEST**2
"""How much harder folds that lie against each other bend than the wall does [1]: as a ring of its modulus that is
pressed together to `SHORTEST`, where half of the bending of the wall's thin tube is left to its pleats."""

POSE = 7
"""Numbers of a node's pose: displacement from rest [m], and the unit quaternion that has turned its cross-section."""


AT_REST = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""Pose of a node that has not moved."""


class AxisDisplacement(NamedTuple):
    """Where the axes are; leading axis: worlds."""

    pose: Array
    """(worlds, nodes, 7): displacement from rest [m], and turn from rest as a unit quaternion. A turn counts as brought
    along to where the axis goes now (`haustra.models.wall.sections.brought_along`)."""
    speed: Array
    """(worlds, nodes, 4): velocity [m/s], and angular velocity about the axis' own direction [rad/s]."""


class AxisShape(NamedTuple):
    """How axes lie, and how their cross-sections go along; leading axis: worlds."""

    units: Array
    """(worlds, nodes - 1, 3) directions of the edges."""
    lengths: Array
    """(worlds, nodes - 1) of the edges [m]."""
    tangents: Array
    """(worlds, nodes, 3) directions of the axis."""
    sums: Array
    """(worlds, nodes) lengths of the sums of neighbouring edges' directions."""
    turns: Array
    """(worlds, nodes, 4) turns of the sections from rest, as unit quaternions."""
    closings: Array
    """(worlds, nodes - 1, 3) `haustra.models.wall.sections.cell_closing` between nodes [1/m]."""
    flats: Array
    """(worlds, nodes) share by which cross-sections are flattened."""
    acrosses: Array
    """(worlds, nodes, 3) direction in which they are."""


class AttachmentPoints(NamedTuple):
    """Where points hold on to the wall; leading axes: worlds, points."""

    arcs: Array
    """Arc length [m]."""
    lever: Array
    """(..., 3) from the axis to the point, in the colon at rest [m]."""


# Laws of one node, edge or point.


def edge_tension(xp: Any, length: Any, rest: Any, tension: Any, pleating: Any) -> Any:
    """Force in an edge [N], positive where it is stretched.

    Folds that lie against each other, at `SHORTEST` of the length at rest, are a ring of wall: what is left of its
    length, s, is pressed like a solid of the same modulus and volume (neo-Hookean), by EA / (3 `SHORTEST`) (s - 1/s^2).
    """
    strain = length / rest - 1
    stiffness = where(xp, strain > 0, tension, tension * pleating)
    left = xp.minimum(length / (SHORTEST * rest), 1.0)
    return stiffness * strain + tension / (3 * SHORTEST) * (left - 1 / (left * left))


def gas_thrust(xp: Any, lost: Any, drag: Any, turn_drag: Any, tension: Any) -> Any:
    """Force in an edge for the gas that a colon has lost since it was imaged [N]: that much less holds it apart.

    Gas of pressure p thrusts the ends of a tube of cross-section A apart by p A: shorter by dL, the tube displaces A dL
    of gas, which takes the work p A dL. A colon was imaged in balance with that, so what p A has lost since draws the
    ends of an edge together.

    Args:
        xp: numpy or jax.numpy.
        lost: what p A has lost, over A as it was imaged [Pa].
        drag: damping of the node before the edge [N s/m].
        turn_drag: the same of its turning, which knows the radius (`haustra.models.wall.threads.lumen_radius`) [N m s].
        tension: EA of the edge [N]; 0 of one that is no colon.
    """
    return where(xp, tension > 0, lost * math.pi * turn_drag / drag, 0.0)


def edge_stiffness(xp: Any, length: Any, rest: Any, tension: Any) -> Any:
    """Slope of `edge_tension` over the strain [N], or more: as much as in a stretched edge."""
    left = length / (SHORTEST * rest)
    packed = tension / (3 * SHORTEST * SHORTEST) * (1 + 2 / (left * left * left))
    return tension + where(xp, left < 1, packed, 0.0)


class Bend(NamedTuple):
    """What a wall does against a bend at a node."""

    gradient: Vector
    """Gradient of its energy over the change of direction from one edge to the next [N m]."""
    tension: Any
    """Force in both edges [N]: what lengthens them bends the wall."""


def wall_bend(xp: Any, length: Any, rest: Any, change: Vector, turn: Any, bending: Any) -> Bend:
    """How a wall resists a bend, of the energy B (-4 ln cos(t/2) - s q a + s^2 q a_0 / 2), where a = 2 sin(t/2).

    The moment at a node that bends by an angle t is B (2 tan(t/2) - s q cos(t/2)), with q such that there is none at
    rest, at t_0: B (t - s t_0) where it bends little, and without bound where it would fold back on itself (Bergou et
    al. 2008). A wall that is gathered to a share s of its length is so on either side of a bend alike: its folds are as
    many as before and as much nearer to each other, so that it bends by as much less from node to node, and keeps its
    curvature. Only how much it bends counts, not to which side: a tube that may turn about itself.

    Args:
        xp: numpy or jax.numpy.
        length: of both edges beside the node together [m].
        rest: the same at rest [m].
        change: difference of the edges' directions.
        turn: 2 tan(t_0/2).
        bending: B [N m].
    """
    amount, steep, stretch = norm(xp, change), xp.sqrt(1 + 0.25 * turn * turn), length / rest
    facing = xp.maximum(4 - amount * amount, LEAST_FACING * LEAST_FACING)
    own = bending * turn * steep
    return Bend(
        times(4 * bending / facing - own * stretch / amount, change), own * (stretch * turn / steep - amount) / rest
    )


def bend_energy(xp: Any, length: Any, rest: Any, amount: Any, turn: Any, bending: Any) -> Any:
    """Energy of `wall_bend` [J], less what it is at rest, given the length of the change of direction."""
    steep, stretch = xp.sqrt(1 + 0.25 * turn * turn), length / rest
    apart = 2 * xp.log(steep * steep * (1 - 0.25 * amount * amount))
    return bending * (turn * (turn * (1 + stretch * stretch) / 2 - stretch * amount * steep) - apart)


def bend_stiffness(xp: Any, bending: Any, facing: Any) -> Any:
    """Slope of the moment of `wall_bend` over the angle [N m], given the length of the sum of both directions."""
    facing = xp.maximum(facing, LEAST_FACING)
    return 4 * bending / (facing * facing)


class PackedBend(NamedTuple):
    """What folds that lie against each other do against a bend at a node."""

    gradient: Vector
    """Gradient of their energy over the change of direction from one edge to the next [N m]."""
    tension: Any
    """Force in both edges [N]: a bend opens folds."""
    stiffness: Any
    """Half of a bound of the moment's slope over the angle [N m], with which a step is stable."""
    along: Any
    """Half of a bound of the slope of the tension in either edge [N/m]."""


def packed_bend(xp: Any, length: Any, rest: Any, change: Vector, turn: Any, bending: Any, width: Any) -> PackedBend:
    """How a wall resists a bend by the folds that meet on its inside, beside `wall_bend`.

    Folds that lie against each other are a solid ring (`edge_tension`), which bends `STACKED` times as hard as the wall
    does. Bent by a, in 2 sin(t/2), more than folds bend by themselves that lie against each other (`folded_bend`), the
    wall is shorter on the inside by e = w a / l_0 of its length at rest, and longer on the outside; with p by how much
    the axis is shorter than `SHORTEST`, the energy is k/2 ((p + e)+^2 / 2 + (p - e)+^2 / 2 - p+^2), of which
    `edge_tension` has the last.

    Args:
        xp: numpy or jax.numpy.
        length: of both edges beside the node together [m].
        rest: the same at rest [m].
        change: difference of the edges' directions.
        turn: 2 tan(t_0/2).
        bending: B [N m].
        width: w, from the axis to the wall on the inside [m].
    """
    per, amount = 2 * width / rest, norm(xp, change)
    firm = STACKED * bending / (per * per)
    inner, outer, both = _pressed(xp, length, rest, per * (amount - folded_bend(xp, turn, per)))
    moment, squeezed = 0.5 * firm * per * (inner - outer), 0.5 * firm * (inner + outer - 2 * both)
    resists = where(xp, inner + outer > 0, firm, 0.0)
    return PackedBend(
        times(moment / amount, change), -squeezed / rest, 0.5 * resists * per * per, resists / (rest * rest)
    )


def packed_energy(xp: Any, length: Any, rest: Any, amount: Any, turn: Any, bending: Any, width: Any) -> Any:
    """Energy of `packed_bend` [J], given the length of the change of direction."""
    per = 2 * width / rest
    inner, outer, both = _pressed(xp, length, rest, per * (amount - folded_bend(xp, turn, per)))
    return 0.25 * STACKED * bending / (per * per) * (inner * inner + outer * outer - 2 * both * both)


def packed_resistance(xp: Any, length: Any, before: tuple[Any, Any], after: tuple[Any, Any], h: Any) -> Any:
    """What a step's speed difference meets between nodes beside which folds lie against each other [N s/m].

    Along the edge and across it, and all of the speed: were it changes of speed along it, as in `edge_resistance`,
    folds that meet at a speed would go on at it, with a mass that came from nowhere.

    Args:
        xp: numpy or jax.numpy.
        length: of the edge [m].
        before: `PackedBend.stiffness` and `PackedBend.along` of the node before.
        after: of the node after.
        h: time step [s].
    """
    return h * (4 * xp.maximum(before[0], after[0]) / (length * length) + before[1] + after[1])


def _pressed(xp: Any, length: Any, rest: Any, bent: Any) -> tuple[Any, Any, Any]:
    """By how much of their length at rest folds are pressed on the inside of a bend, its outside, and at the axis."""
    packed = SHORTEST - length / rest
    return xp.maximum(packed + bent, 0.0), xp.maximum(packed - bent, 0.0), xp.maximum(packed, 0.0)


def folded_bend(xp: Any, turn: Any, per: Any) -> Any:
    """By how much folds that lie against each other bend by themselves, in 2 sin(t/2) [1].

    They are as many on either side as they were at rest, where the wall was longer on the outside: they bend by
    `SHORTEST` of the angle at rest. Where that is so sharp that the wall on the inside has no length, it has at least
    that of its folds.

    Args:
        xp: numpy or jax.numpy.
        turn: 2 tan(t_0/2).
        per: by how much of its length at rest the wall on the inside is shorter in a bend of 1 [1].
    """
    chord = turn / xp.sqrt(1 + 0.25 * turn * turn)
    return xp.maximum(SHORTEST * chord, chord - (1 - SHORTEST) / per)


def hold_force(xp: Any, place: Vector, slack: Any, hold: Any, support: Any) -> Vector:
    """Force of mesentery and surroundings on a node [N], so far from what it hangs on [m].

    Where that is a root, a part of the node's load makes up for surroundings that pull from where it is at rest.
    """
    moved = norm(xp, place)
    return times(-hold * xp.maximum(moved - slack, 0.0) / moved - support, place)


def mesentery_extension(xp: Any, own: Mesentery, displacement: Any, time: Any = 0.0) -> Any:
    """How far the mesentery is drawn out beyond its slack at each node of axes (*worlds, nodes) [m].

    A node without slack has no mesentery: it is fixed to the back wall, or to the pelvic floor.

    Args:
        xp: numpy or jax.numpy.
        own: the axis of one colon, or of one a world.
        displacement: poses of its nodes (*worlds, nodes, 7), in the coordinates of `own` [m].
        time: when breath has moved what they hang on (*worlds,) [s].
    """
    moved = norm(xp, hung(xp, own, vectors.of(displacement), xp.asarray(time)))
    return xp.where(own.slack > 0, xp.maximum(moved - own.slack, 0.0), 0.0)


def node_resistance(
    xp: Any, place: Vector, slack: Any, hold: Any, support: Any, drag: Any, gripped: Any, h: Any
) -> Any:
    """What a step's speed meets at a node by itself: damping, and h times a bound of its springs [N s/m]."""
    return drag + gripped + h * (support + where(xp, dot(place, place) > slack**2, hold, 0.0))


def node_turn_resistance(upright: Any, drag: Any, gripped: Any, h: Any) -> Any:
    """What a step's angular velocity meets at a node by itself: damping, and h times a bound of its springs [N m s]."""
    return drag + gripped + h * upright


def edge_resistance(xp: Any, length: Any, rest: Any, tension: Any, before: Any, after: Any, h: Any) -> tuple[Any, Any]:
    """What a step's speed difference meets between nodes [N s/m]: h times a bound of the springs along and across.

    Bending resists most from node to node, by four times its stiffness, `before` and `after`, over the distance now. It
    does so across the edge only: along it, what is more in a pleated edge than at rest, returned second, is to resist
    changes of speed, not speed.
    """
    bending = 4 * h * xp.maximum(before, after)
    at_rest, now = bending / (rest * rest), bending / (length * length)
    return h * edge_stiffness(xp, length, rest, tension) / rest + now, xp.maximum(now - at_rest, 0.0)


def grip_resistance(damping: Any) -> Any:
    """What changes of a step's speeds meet where a contact is damped so much along its normal [N s/m].

    A place of the wall moves by what the axis moves and its section turns, leans and flattens: four parts, whose sum
    squared is at most four times the sum of their squares. A step is stable that resists by half of that. Friction is
    bounded, and needs less.
    """
    return 2 * damping


def lean_grip(xp: Any, force: Vector, damping: Any, drag: Any) -> Any:
    """What changes of a section's leaning meet at a contact of that force [N s/m].

    Friction that sticks would hold up a section that rolls about the contact: it counts for `LEANS` at most.

    Args:
        xp: numpy or jax.numpy.
        force: of the contact [N].
        damping: along its normal, as `grip_resistance` [N s/m].
        drag: across it [N s/m].
    """
    return damping + xp.minimum(drag, LEANS * norm(xp, force))


def lean_resistance(leaning: Any, sums: Any) -> Any:
    """What changes of either edge's direction at a node meet [N m s], given what those of its tangent do."""
    return 2 * leaning / (sums * sums)


def node_cell(xp: Any, spacing: Any, nodes: Any, arc: Any) -> tuple[Any, Any]:
    """Node before an arc length, and the share of the way to the next, of that many nodes."""
    way = arc / spacing
    at = xp.int32(xp.floor(where(xp, way > 0, xp.minimum(way, nodes - 2), 0.0)))  # NaN: the first
    return at, xp.minimum(xp.maximum(way - at, 0.0), 1.0)


PARTS = (
    edge_tension,
    gas_thrust,
    edge_stiffness,
    wall_bend,
    bend_stiffness,
    packed_bend,
    packed_resistance,
    _pressed,
    folded_bend,
    hold_force,
    node_resistance,
    node_turn_resistance,
    edge_resistance,
    grip_resistance,
    lean_grip,
    lean_resistance,
    node_cell,
)
"""What numba is to compile."""


# Arrays of them.


def at_rest(xp: Any, own: Mesentery, worlds: int, kind: Any) -> AxisDisplacement:
    """Nothing has moved."""
    nodes = own.nodes.shape[-2]
    pose = xp.zeros((worlds, nodes, POSE), kind) + xp.asarray(AT_REST, kind)
    return AxisDisplacement(pose, xp.zeros((worlds, nodes, 4), kind))


def query(
    xp: Any,
    tables: Tables,
    displacement: AxisDisplacement,
    points: Array,
    arcs: Array,
    radius: Array,
    *,
    threaded: int = 0,
) -> tuple[WallQuery, AttachmentPoints]:
    """As `haustra.models.wall.lumen_table.query`, in a colon that has moved: tables of one colon a world.

    Spheres of that radius (worlds or 1, points or 1) [m] hold on to the wall with their surfaces. As many of them as
    are `threaded` follow each other on a shaft, from its end to its tip (`haustra.models.wall.threads`).
    """
    own = _mesentery_of(tables)
    shape = shape_of(xp, own, displacement.pose)
    rest = to_reference(xp, tables, displacement.pose, shape, points, arcs)
    found = table.query(xp, tables, rest, arcs, _most_arcs(xp, points, arcs, threaded))
    at, share = _cell(xp, own, found.arcs)
    both = _section(shape, at), _section(shape, at + 1)
    depth, normal, lever = touched(xp, found.depth, vectors.of(found.inwards), radius, *both, share)
    offset, world = vectors.of(rest - table.axis_at(xp, tables, found.arcs)), _worlds(at)
    along = vectors.of(own.tangents[world, at]), vectors.of(own.tangents[world, at + 1])
    grip = AttachmentPoints(found.arcs, stacked(xp, held_at(offset, lever, along, share)))
    return found._replace(depth=depth, inwards=stacked(xp, normal)), grip


def _most_arcs(xp: Any, points: Array, arcs: Array, threaded: int) -> Array:
    """Arc lengths beyond which points are not looked up (worlds, points) [m]; without bound but on a shaft."""
    own, upto = points[:, :threaded], arcs[:, : max(threaded - 1, 0)]
    bound = threaded_arc(xp, np.inf, upto, norm(xp, vectors.of(own[:, 1:] - own[:, :-1])))
    first = min(threaded, 1)
    free = [xp.full_like(arcs[:, :count], np.inf) for count in (first, arcs.shape[1] - first - bound.shape[1])]
    return xp.concatenate([free[0], bound, free[1]], axis=1)


def shape_of(xp: Any, own: Mesentery, pose: Array) -> AxisShape:
    """How axes lie whose nodes have such poses (worlds, nodes, 7)."""
    nodes = own.nodes + pose[..., :3]
    edges = vectors.of(nodes[:, 1:] - nodes[:, :-1])
    lengths = norm(xp, edges)
    units = stacked(xp, times(1 / lengths, edges))
    sums = vectors.of(_at_nodes(xp, units))
    tangents, rest = times(1 / norm(xp, sums), sums), vectors.of(own.tangents)
    turn = brought_along(xp, (pose[..., 3], vectors.of(pose[..., 4:])), rest, tangents)
    ends = stacked(xp, tangents)
    closings = stacked(xp, cell_closing(xp, *_at_ends(ends), lengths))
    closing = node_closing(*_beside(xp, closings), tangents)
    flat, across = flattening(xp, closing, turned(*turn, vectors.of(own.closings)), own.widths)
    return AxisShape(
        units=units,
        lengths=lengths,
        tangents=ends,
        sums=norm(xp, sums),
        turns=xp.stack([turn[0], *turn[1]], axis=-1),
        closings=closings,
        flats=flat,
        acrosses=stacked(xp, across),
    )


def to_reference(xp: Any, tables: Tables, pose: Array, shape: AxisShape, points: Array, arcs: Array) -> Array:
    """Points near those arc lengths, as if the colon around them had not moved (worlds, points, 3) [m].

    Args:
        xp: numpy or jax.numpy.
        tables: of each world.
        pose: of the nodes (worlds, nodes, 7).
        shape: `shape_of` them.
        points: [m].
        arcs: [m].
    """
    own = _mesentery_of(tables)
    axis = table.axis_at(xp, tables, arcs)
    at, share = _cell(xp, own, arcs)
    world = _worlds(at)
    back = taken_back(
        xp,
        vectors.of(points - axis - _between(pose[..., :3], at, share)),
        shape.lengths[world, at] / own.lengths[world, at],
        (vectors.of(own.tangents[world, at]), vectors.of(own.tangents[world, at + 1])),
        (_rest_closing(xp, own, at), vectors.of(shape.closings[world, at])),
        _section(shape, at),
        _section(shape, at + 1),
        share,
    )
    return axis + stacked(xp, back)


def back_to_reference(xp: Any, tables: Tables, pose: Array) -> Callable[[Array, Array], Array]:
    """`to_reference` with such poses of the nodes, of points and arc lengths."""
    shape = shape_of(xp, _mesentery_of(tables), pose)
    return lambda points, arcs: to_reference(xp, tables, pose, shape, points, arcs)


def to_current(xp: Any, tables: Tables, pose: Array, points: Array, arcs: Array) -> Array:
    """Points of the colon at rest at those arc lengths (worlds, points, 3), where they are now [m]."""
    return _current(xp, tables, pose, shape_of(xp, _mesentery_of(tables), pose), points, arcs)


def directions(xp: Any, own: Mesentery, pose: Array, arcs: Array, v: Array) -> Array:
    """Vectors from the axis in the colon at rest (worlds, points, 3), as they stand where it is now."""
    return _carried(xp, own, shape_of(xp, own, pose), arcs, v)


def section_poses(
    xp: Any, tables: Tables, pose: Array, shape: AxisShape, points: Array, arcs: Array
) -> tuple[Array, Array]:
    """Where bodies are that go along with cross-sections at arc lengths, and how they are turned from rest.

    Args:
        xp: numpy or jax.numpy.
        tables: of each world.
        pose: of the nodes (worlds, nodes, 7).
        shape: `shape_of` them; bodies are rigid, so that flattened sections place them but do not flatten them.
        points: where the bodies are at rest (worlds, points, 3) [m].
        arcs: [m].

    Returns:
        Points [m], and quaternions (worlds, points, 4).
    """
    own = _mesentery_of(tables)
    at, share = _cell(xp, own, arcs)
    before, after = shape.turns[_worlds(at), at], shape.turns[_worlds(at), at + 1]
    alike = xp.sign((before * after).sum(-1, keepdims=True))
    turn = before + share[..., None] * (alike * after - before)
    turn = turn / xp.linalg.norm(turn, axis=-1, keepdims=True)
    return _current(xp, tables, pose, shape, points, arcs), turn


def axis_at(xp: Any, tables: Tables, pose: Array | None, arcs: Array) -> Array:
    """Points of the centreline at arc lengths, where it is now [m]; without displacements, where it is fixed."""
    still = table.axis_at(xp, tables, arcs)
    return still if pose is None else still + _between(pose[..., :3], *_cell(xp, _mesentery_of(tables), arcs))


def axis_places(xp: Any, own: Mesentery, pose: Array, arcs: Array) -> Array:
    """Points of the axis between its nodes at arc lengths (worlds, points), where it is now [m]."""
    return _between(own.nodes + pose[..., :3], *_cell(xp, own, arcs))


def wall_speeds(xp: Any, own: Mesentery, displacement: AxisDisplacement, grip: AttachmentPoints) -> Array:
    """Speeds of the wall where points hold on to it (worlds, points, 3) [m/s]; none before the anus."""
    shape = shape_of(xp, own, displacement.pose)
    rates = vectors.of(displacement.speed[:, 1:, :3] - displacement.speed[:, :-1, :3])
    edges = stacked(xp, unit_rate(vectors.of(shape.units), shape.lengths, rates))
    tangents = unit_rate(vectors.of(shape.tangents), shape.sums, vectors.of(_at_nodes(xp, edges)))
    spin = add(
        cross(vectors.of(shape.tangents), tangents), times(displacement.speed[..., 3], vectors.of(shape.tangents))
    )
    moving, stretching = stacked(xp, tangents), dot(vectors.of(shape.units), rates)
    changing = cell_closing_rate(xp, *_at_ends(shape.tangents), shape.lengths, *_at_ends(moving), stretching)
    changing = stacked(xp, changing)
    cells, cell_rates = _beside(xp, shape.closings), _beside(xp, changing)
    before = _turned(shape, own.closings)
    flat_rate, across_rate = flattening_rate(
        xp,
        node_closing(*cells, vectors.of(shape.tangents)),
        before,
        own.widths,
        node_closing_rate(*cells, vectors.of(shape.tangents), *cell_rates, tangents),
        cross(spin, before),
    )
    spins, across_rates = stacked(xp, spin), stacked(xp, across_rate)
    at, share = _cell(xp, own, grip.arcs)
    world, lever = _worlds(at), vectors.of(grip.lever)

    def rate(node: Array) -> Vector:
        rates = vectors.of(spins[world, node]), flat_rate[world, node], vectors.of(across_rates[world, node])
        return carried_rate(_section(shape, node), rates, lever)

    turning = stacked(xp, between(rate(at), rate(at + 1), share))
    return xp.where((grip.arcs > 0)[..., None], _between(displacement.speed[..., :3], at, share) + turning, 0.0)


def step_axis(
    xp: Any,
    own: Mesentery,
    displacement: AxisDisplacement,
    grip: AttachmentPoints,
    force: Array,
    damping: Array,
    h: Array,
    *,
    time: Array | None = None,
    found: Array | None = None,
    drawn: Drawn | None = None,
) -> AxisDisplacement:
    """One time step.

    Args:
        xp: numpy or jax.numpy.
        own: of each world.
        displacement: where the axes are.
        grip: where the device holds on to the wall.
        force: on the wall there, at the end of the step as the device sees it (worlds, points, 3) [N].
        damping: of each contact along its normal, and at least that across it (worlds, points, 2) [N s/m].
        h: time step [s].
        time: of each world, where there is an envelope or breath around the colon (worlds,) [s].
        found: partners of nodes (worlds, nodes), where loops touch (`haustra.models.wall.loops.partners`).
        drawn: what a shaft does to the nodes between its spheres (`haustra.models.wall.threads.drawn`).
    """
    inside = grip.arcs > 0
    force, damping = (xp.where(inside[..., None], part, 0.0) for part in (force, damping))
    pressed = grip_resistance(damping[..., 0])
    resists, square = pressed + damping[..., 1], (grip.lever**2).sum(-1)
    cell = _cell(xp, own, grip.arcs)
    couples = _onto_nodes(xp, own, cell, force[..., :, None] * grip.lever[..., None, :])
    leans = lean_grip(xp, vectors.of(force), pressed, damping[..., 1])
    parts = resists, resists * square, pressed * square, leans * square
    gripped, gripped_turn, flattened, leaning = (_onto_nodes(xp, own, cell, part) for part in parts)
    around = _surroundings(xp, own, displacement.pose, time, found)
    springs, turning, shape, packed = _forces(xp, own, displacement.pose, couples, around)
    pulled = _onto_nodes(xp, own, cell, force) + springs + gripped[..., None] * displacement.speed[..., :3]
    diagonal = node_resistance(xp, around.hung, own.slack, own.hold, own.support, own.drag, gripped, h)
    diagonal = diagonal + h * around.stiffness
    if drawn is not None:
        pulled, diagonal = pulled + drawn.force, diagonal + h * drawn.stiffness
    stiff = bend_stiffness(xp, own.bending, shape.sums) + own.upright
    tie, along = edge_resistance(xp, shape.lengths, own.lengths, own.tension, stiff[:, :-1], stiff[:, 1:], h)
    firm, opens = (xp.pad(part, ((0, 0), (1, 1))) for part in (packed.stiffness, packed.along))
    before, after = (firm[:, :-1], opens[:, :-1]), (firm[:, 1:], opens[:, 1:])
    tie = tie + packed_resistance(xp, shape.lengths, before, after, h)
    leaning = lean_resistance(leaning + _flattening(xp, own, shape, flattened), shape.sums)
    held = (leaning[:, 1:] + leaning[:, :-1]) / shape.lengths**2
    apart = displacement.speed[:, 1:, :3] - displacement.speed[:, :-1, :3]
    kept = held[..., None] * apart + (along * (shape.units * apart).sum(-1))[..., None] * shape.units
    pulled = pulled + _from_edges(xp, kept)
    velocity = _solved(xp, diagonal, tie + held, pulled)
    turning = (turning + gripped_turn * displacement.speed[..., 3])[..., None]
    diagonal = node_turn_resistance(own.upright, own.turn_drag, gripped_turn, h)
    spin = _solved(xp, diagonal, h * own.torsion, turning)
    speed = xp.concatenate([velocity, spin], axis=-1)
    return AxisDisplacement(_after(xp, displacement.pose, speed, shape, h), speed)


def poses_seen_from(poses: Array, axes: Array) -> Array:
    """Poses (..., nodes, 7) in coordinates whose axes are the columns of `axes`."""
    each = np.zeros((POSE, POSE))
    each[:3, :3], each[3, 3], each[4:, 4:] = axes, 1.0, axes
    return poses @ each


def carried_on(xp: Any, own: Mesentery, displacement: AxisDisplacement, time: Any) -> Array:
    """Poses of the nodes (worlds, nodes, 7) after a short time at their speed [s]."""
    return _after(xp, *displacement, shape_of(xp, own, displacement.pose), time)


def _after(xp: Any, pose: Array, speed: Array, shape: AxisShape, time: Any) -> Array:
    turn = twisted(_turn_of(shape), vectors.of(shape.tangents), time * speed[..., 3])
    moved = pose[..., :3] + time * speed[..., :3]
    return xp.concatenate([moved, xp.stack([turn[0], *turn[1]], axis=-1)], axis=-1)


def spring_forces(
    xp: Any, own: Mesentery, pose: Array, couples: Array, time: Array | None = None, found: Array | None = None
) -> tuple[Array, Array]:
    """Forces of the axis, its mesentery, its load and what turns cross-sections on the nodes, and torques about it.

    Args:
        xp: numpy or jax.numpy.
        own: of each world.
        pose: of the nodes (worlds, nodes, 7).
        couples: sums of f v^T of forces on vectors from each node's axis to the wall (worlds, nodes, 3, 3) [N m].
        time: of each world, where there is an envelope or breath (worlds,) [s].
        found: partners of nodes (worlds, nodes), where loops touch.

    Returns:
        Forces (worlds, nodes, 3) [N], and torques about the tangents (worlds, nodes) [N m].
    """
    return _forces(xp, own, pose, couples, _surroundings(xp, own, pose, time, found))[:2]


class _Surroundings(NamedTuple):
    """What lies around nodes (worlds, nodes)."""

    hung: Vector
    """How far they are from what they hang on [m]."""
    force: Vector
    """Force of the envelope and of other loops [N]."""
    stiffness: Array
    """Bound of that force's slope [N/m]."""
    energy: Array
    """Energy of that force [J]."""


def _surroundings(xp: Any, own: Mesentery, pose: Array, time: Array | None, found: Array | None) -> _Surroundings:
    around = _outside(xp, own, pose, time)
    if found is None:
        return around
    force, stiffness, stored = touching(xp, own, pose, found)
    both = add(around.force, vectors.of(force))
    return _Surroundings(around.hung, both, around.stiffness + stiffness, around.energy + stored)


def _outside(xp: Any, own: Mesentery, pose: Array, time: Array | None) -> _Surroundings:
    place, none = vectors.of(pose), xp.zeros_like(pose[..., 0])
    if time is None:
        return _Surroundings(add(place, vectors.of(own.root)), (none, none, none), none, none)
    left, back, head = (vectors.of(own.body[:, i, None, :]) for i in range(3))
    drawn = breath(xp, own.breaths[:, 1], time)[:, None]
    walls = own.walls[:, 0, None], own.walls[:, 1, None]
    room = tuple(own.room[..., side] for side in range(6))
    envelope = place, (left, back, head), room, walls, drawn * own.breaths[:, 0, None]
    return _Surroundings(hung(xp, own, place, time), *envelope_force(xp, *envelope), envelope_energy(xp, *envelope))


def _forces(
    xp: Any, own: Mesentery, pose: Array, couples: Array, around: _Surroundings
) -> tuple[Array, Array, AxisShape, PackedBend]:
    shape = shape_of(xp, own, pose)
    tangents = vectors.of(shape.tangents)
    rows = vectors.of(couples[..., 0, :]), vectors.of(couples[..., 1, :]), vectors.of(couples[..., 2, :])
    section = *_turn_of(shape), shape.flats, vectors.of(shape.acrosses)
    beside = _beside(xp, shape.closings)
    rest = vectors.of(own.closings)
    work, torque, first, last = section_gradient(xp, section, tangents, beside, rest, own.widths, rows)
    over_cells = vectors.of(_onto_cells(xp, stacked(xp, first), stacked(xp, last)))
    first, last, shortening = cell_closing_gradient(xp, *_at_ends(shape.tangents), shape.lengths, over_cells)
    sine, binormal = _twists(xp, own, shape)
    moment = own.torsion * sine
    tilt, lean = _upright(xp, own, shape)
    righting = own.upright * tilt
    turning = torque - righting + xp.pad(moment, ((0, 0), (0, 1))) - xp.pad(moment, ((0, 0), (1, 0)))
    twisting = times(moment, binormal)
    work = stacked(xp, minus(work, times(righting, lean)))
    work = work + xp.pad(stacked(xp, minus(first, twisting)), ((0, 0), (0, 1), (0, 0)))
    work = work + xp.pad(stacked(xp, minus(last, twisting)), ((0, 0), (1, 0), (0, 0)))
    work = stacked(xp, unit_rate(tangents, shape.sums, vectors.of(work)))
    change = vectors.of(shape.units[:, 1:] - shape.units[:, :-1])
    inner = *_beside_nodes(own, shape), change, own.turns[:, 1:-1], own.bending[:, 1:-1]
    bend, packed = wall_bend(xp, *inner), packed_bend(xp, *inner, own.widths[:, 1:-1])
    opening = bend.tension + packed.tension
    bend = xp.pad(stacked(xp, add(bend.gradient, packed.gradient)), ((0, 0), (1, 1), (0, 0)))
    over_units = vectors.of(work[:, 1:] + work[:, :-1] + bend[:, 1:] - bend[:, :-1])
    units = vectors.of(shape.units)
    tension = edge_tension(xp, shape.lengths, own.lengths, own.tension, own.pleating[:, None])
    tension = tension + _gas_thrusts(xp, own) - shortening + _onto_edges(xp, opening)
    pull = stacked(xp, minus(times(tension, units), unit_rate(units, shape.lengths, over_units)))
    held = stacked(xp, add(hold_force(xp, around.hung, own.slack, own.hold, own.support), around.force))
    return held + own.load + _from_edges(xp, pull), turning, shape, packed


def _gas_thrusts(xp: Any, own: Mesentery) -> Array:
    """`gas_thrust` of all edges (worlds, nodes - 1) [N]."""
    return gas_thrust(xp, own.pressure_lost[:, None], own.drag[:, :-1], own.turn_drag[:, :-1], own.tension)


def _beside_nodes(own: Mesentery, shape: AxisShape) -> tuple[Array, Array]:
    """Lengths of both edges beside each node between others together, now and at rest [m]."""
    return shape.lengths[:, 1:] + shape.lengths[:, :-1], own.lengths[:, 1:] + own.lengths[:, :-1]


def _onto_edges(xp: Any, values: Array) -> Array:
    """What nodes between others do to both edges beside them (worlds, nodes - 1)."""
    return xp.pad(values, ((0, 0), (1, 0))) + xp.pad(values, ((0, 0), (0, 1)))


def _flattening(xp: Any, own: Mesentery, shape: AxisShape, gripped: Array) -> Array:
    """What changes of the nodes' tangents meet (worlds, nodes) [N m s], of contacts on sections that flatten."""
    closing = node_closing(*_beside(xp, shape.closings), vectors.of(shape.tangents))
    reach = gripped * flattening_reach(xp, closing, _turned(shape, own.closings), own.widths) ** 2
    cells = _onto_cells(xp, reach[..., None], reach[..., None])[..., 0]
    cells = 2 * cells * cell_closing_reach(xp, *_at_ends(shape.tangents), shape.lengths) ** 2
    return xp.pad(cells, ((0, 0), (0, 1))) + xp.pad(cells, ((0, 0), (1, 0)))


def _from_edges(xp: Any, pull: Array) -> Array:
    """Forces on the nodes of edges that pull at the node before them (worlds, nodes - 1, 3)."""
    return xp.pad(pull, ((0, 0), (0, 1), (0, 0))) - xp.pad(pull, ((0, 0), (1, 0), (0, 0)))


def _solved(xp: Any, diagonal: Array, tie: Array, right: Array) -> Array:
    """Solve for what nodes that resist by themselves and are tied to their neighbours do."""
    below, above = xp.pad(tie, ((0, 0), (1, 0))), xp.pad(tie, ((0, 0), (0, 1)))
    return solve_tridiagonal(xp, -below, diagonal + below + above, -above, right)


def _twists(xp: Any, own: Mesentery, shape: AxisShape) -> tuple[Array, Vector]:
    """`haustra.models.wall.sections.twist` of each edge."""
    before, after = (_quaternion(shape.turns[:, part]) for part in (slice(-1), slice(1, None)))
    return twist(xp, before, after, _at_ends(shape.tangents), _quaternion(own.ways))


def _upright(xp: Any, own: Mesentery, shape: AxisShape) -> tuple[Array, Vector]:
    """`haustra.models.wall.sections.twist` of each node against what holds it."""
    return twist(xp, STILL, _turn_of(shape), (vectors.of(own.tangents), vectors.of(shape.tangents)), STILL)


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


def energy(xp: Any, own: Mesentery, pose: Array, time: Array | None = None, found: Array | None = None) -> Array:
    """Stored in the axis, its mesentery and its load, at a time [s] in its surroundings, with partners between loops.

    Returns:
        (worlds,) [J].
    """
    shape, place = shape_of(xp, own, pose), pose[..., :3]
    strain = shape.lengths / own.lengths - 1
    tension = xp.where(strain > 0, own.tension, own.tension * own.pleating[:, None])
    along = 0.5 * tension * own.lengths * strain**2
    left = xp.minimum(shape.lengths / (SHORTEST * own.lengths), 1.0)
    along = along + own.tension * own.lengths / 3 * (0.5 * left**2 + 1 / left - 1.5)
    along = along + _gas_thrusts(xp, own) * shape.lengths
    change = norm(xp, vectors.of(shape.units[:, 1:] - shape.units[:, :-1]))
    inner = *_beside_nodes(own, shape), change, own.turns[:, 1:-1], own.bending[:, 1:-1]
    bent = bend_energy(xp, *inner) + packed_energy(xp, *inner, own.widths[:, 1:-1])
    around = _surroundings(xp, own, pose, time, found)
    moved = norm(xp, around.hung)
    held = 0.5 * own.hold * xp.maximum(moved - own.slack, 0.0) ** 2 + 0.5 * own.support * moved**2
    wound = own.torsion * _twist_energy(xp, _twists(xp, own, shape)[0])
    held = held + own.upright * _twist_energy(xp, _upright(xp, own, shape)[0]) - (own.load * place).sum(-1)
    held = held + around.energy
    return along.sum(axis=1) + bent.sum(axis=1) + held.sum(axis=1) + wound.sum(axis=1)


def _twist_energy(xp: Any, sine: Array) -> Array:
    """1 - cos of a twist of less than a right angle, of which this is the sine."""
    return sine**2 / (1 + xp.sqrt(xp.maximum(1 - sine**2, 0.0)))


def _current(xp: Any, tables: Tables, pose: Array, shape: AxisShape, points: Array, arcs: Array) -> Array:
    own, axis = _mesentery_of(tables), table.axis_at(xp, tables, arcs)
    moved = _between(pose[..., :3], *_cell(xp, own, arcs))
    return axis + moved + _carried(xp, own, shape, arcs, points - axis)


def _mesentery_of(tables: Tables) -> Mesentery:
    assert tables.mesentery is not None, "tables of a colon that is fixed in space"
    return tables.mesentery


def _carried(xp: Any, own: Mesentery, shape: AxisShape, arcs: Array, v: Array) -> Array:
    """Vectors from the axis of the colon at rest at those arc lengths (worlds, points, 3), as they stand now."""
    at, share = _cell(xp, own, arcs)
    before, after = (carried(_section(shape, node), vectors.of(v)) for node in (at, at + 1))
    return stacked(xp, between(before, after, share))


def _quaternion(turns: Array) -> Turn:
    return turns[..., 0], vectors.of(turns[..., 1:])


def _turn_of(shape: AxisShape) -> Turn:
    return _quaternion(shape.turns)


def _turned(shape: AxisShape, v: Array) -> Vector:
    """Vectors of the nodes at rest (worlds, nodes, 3), turned."""
    return turned(*_turn_of(shape), vectors.of(v))


def _section(shape: AxisShape, node: Array) -> Section:
    """Sections of nodes (worlds, points)."""
    world = _worlds(node)
    turn = _quaternion(shape.turns[world, node])
    return *turn, shape.flats[world, node], vectors.of(shape.acrosses[world, node])


def _rest_closing(xp: Any, own: Mesentery, at: Array) -> Vector:
    """`cell_closing` at rest behind those nodes (worlds, points)."""
    world = _worlds(at)
    before, after = vectors.of(own.tangents[world, at]), vectors.of(own.tangents[world, at + 1])
    return cell_closing(xp, before, after, own.lengths[world, at])


def _beside(xp: Any, cells: Array) -> tuple[Vector, Vector]:
    """Vectors of the cells (worlds, nodes - 1, 3) before and after each node; at the ends the one there is, twice."""
    return (
        vectors.of(xp.concatenate([cells[:, :1], cells], axis=1)),
        vectors.of(xp.concatenate([cells, cells[:, -1:]], axis=1)),
    )


def _at_ends(values: Array) -> tuple[Vector, Vector]:
    """Vectors of the nodes (worlds, nodes, 3) before and after each edge."""
    return vectors.of(values[:, :-1]), vectors.of(values[:, 1:])


def _onto_cells(xp: Any, first: Array, last: Array) -> Array:
    """Gradients over the cells (worlds, nodes - 1, 3), of those of nodes over the cells before and after them."""
    ends = ((0, 0), (0, first.shape[1] - 2), (0, 0)), ((0, 0), (first.shape[1] - 2, 0), (0, 0))
    return first[:, 1:] + last[:, :-1] + xp.pad(first[:, :1], ends[0]) + xp.pad(last[:, -1:], ends[1])


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


def _shifted(xp: Any, values: Array, by: int, fill: float = 0.0) -> Array:
    """Values of the nodes `by` places before each, or that many after where it is negative; `fill` beyond the ends."""
    more = xp.full((values.shape[0], abs(by), *values.shape[2:]), fill, values.dtype)
    if by > 0:
        return xp.concatenate([more, values[:, :-by]], axis=1)
    return xp.concatenate([values[:, -by:], more], axis=1)
