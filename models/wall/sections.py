"""How the cross-sections of a colon that moves go along with its axis: turned, twisted, flattened where a bend closes.

A section turns along with the axis' tangent, without twisting (parallel transport in time: Bergou et al. 2008), and
what twists it turns it about the tangent. Where a bend closes, sections on it flatten towards its inside
(`flattening`), so that the wall there never passes through the sections beside it, and the map from rest to now stays
one-to-one. Between two sections the map is in proportion.

Laws are written for one node or point with `haustra.models.wall.vectors`: arrays of them are mapped by
`haustra.models.wall.moving_colon`.
"""

from typing import Any, TypeAlias

from haustra.models.wall.vectors import TINY, Vector, add, between, cross, dot, minus, norm, times, unit_rate, where

SHORTEST = 0.35
"""Folds of wall lie against each other where a stretch is pleated to this share of its length at rest [1]; engineering
choice."""
_OPPOSED = 1e-4
"""What points the other way all at once knows no shortest turn: 1 plus the cosine counts as this at least."""
_LEAST_FACING = 0.2
"""Neighbouring sections that face away from each other count as if 1 plus their normals' cosine were this."""
_LEAST_ROOM = 0.05
"""How much further a bend may close that had closed on the wall's inside at rest [1]; keeps quotients finite."""
_LEAST_JACOBIAN = 0.1
"""Arc lengths are not taken back where less of them than this is left on the inside of a bend [1]."""

Turn: TypeAlias = tuple[Any, Vector]
"""A rotation, as a unit quaternion: its real part and its vector."""
Section: TypeAlias = tuple[Any, Vector, Any, Vector]
"""How a cross-section is turned from rest (`Turn`), and then by which share it is flattened along which direction."""


STILL: Turn = 1.0, (0.0, 0.0, 0.0)
"""No turn."""


def turned(real: Any, part: Vector, v: Vector) -> Vector:
    """A vector, turned by a unit quaternion."""
    twice = times(2.0, cross(part, v))
    return add(v, add(times(real, twice), cross(part, twice)))


def turned_back(real: Any, part: Vector, v: Vector) -> Vector:
    """The inverse and transpose of `turned`."""
    return turned(real, times(-1.0, part), v)


def shortest_turn(xp: Any, start: Vector, end: Vector) -> Turn:
    """From one unit vector to another."""
    size = xp.sqrt(2 * xp.maximum(1 + dot(start, end), _OPPOSED))
    return 0.5 * size, times(1 / size, cross(start, end))


def turn_after(first: Turn, second: Turn) -> Turn:
    """Both turns, one after the other."""
    real = second[0] * first[0] - dot(second[1], first[1])
    return real, add(add(times(second[0], first[1]), times(first[0], second[1])), cross(second[1], first[1]))


def brought_along(xp: Any, kept: Turn, rest: Vector, tangent: Vector) -> Turn:
    """How a section is turned whose tangent was brought to `tangent`, without twisting, from where `kept` left it.

    Args:
        xp: numpy or jax.numpy.
        kept: the turn that it had; small errors of its length go.
        rest: tangent at rest.
        tangent: now.
    """
    real, part = turn_after(kept, shortest_turn(xp, turned(kept[0], kept[1], rest), tangent))
    size = 1.5 - 0.5 * (real * real + dot(part, part))
    return size * real, times(size, part)


def twisted(turn: Turn, tangent: Vector, angle: Any) -> Turn:
    """A turn, followed by a small one about the tangent [rad]."""
    return turn_after(turn, (1 - 0.125 * angle * angle, times(0.5 * angle, tangent)))


def twist(xp: Any, before: Turn, after: Turn, tangents: tuple[Vector, Vector], way: Turn) -> tuple[Any, Vector]:
    """Sine of how much a tube is twisted between two sections, and the angle's gradient over either tangent.

    The twist is what turns the first section, brought along to the second's tangent without twisting, into the second.
    Of a quaternion (w, v) that brings along first and then turns by m about the tangent t, tan(m/2) = v . t / w. Where
    a tangent turns, m changes by half the curvature's binormal, of both tangents alike (Bergou et al. 2008, eq. 8).

    Args:
        xp: numpy or jax.numpy.
        before: turn of the first section.
        after: turn of the second.
        tangents: of both now.
        way: the turn that brings the first tangent at rest to the second.
    """
    real, part = turn_after((before[0], times(-1.0, before[1])), turn_after(way, after))
    sine = dot(part, tangents[1])
    angle = 2 * real * sine / (real * real + sine * sine)
    facing = 1 / xp.maximum(1 + dot(tangents[0], tangents[1]), _OPPOSED)
    return angle, times(facing, cross(tangents[0], tangents[1]))


def cell_closing(xp: Any, before: Vector, after: Vector, length: Any) -> Vector:
    """How fast directions change between two nodes [1/m], towards the bend's inside: 2 (t1 - t0) / ((1 + t0 . t1) l).

    Two cross-sections with unit normals t0 and t1 at an angle a, whose middles are l apart, meet in a line that is
    l / (2 sin(a/2)) from both middles where the normals are turned alike from the way between them, and nearer to one
    where they are not: this is 1 / cos(a/2)^2 times as much, which covers both.

    Args:
        xp: numpy or jax.numpy.
        before: tangent at the first node.
        after: at the second.
        length: between them [m].
    """
    return times(2 / (_facing(xp, before, after) * length), minus(after, before))


def _facing(xp: Any, before: Vector, after: Vector) -> Any:
    return xp.maximum(1 + dot(before, after), _LEAST_FACING)


def cell_closing_rate(
    xp: Any, before: Vector, after: Vector, length: Any, rate_before: Vector, rate_after: Vector, longer: Any
) -> Vector:
    """Rate of `cell_closing`, given those of its tangents and length."""
    facing = _facing(xp, before, after)
    turning = where(xp, facing > _LEAST_FACING, dot(rate_before, after) + dot(before, rate_after), 0.0)
    own = times(2 / (facing * length), minus(rate_after, rate_before))
    return minus(own, times(turning / facing + longer / length, cell_closing(xp, before, after, length)))


def cell_closing_gradient(
    xp: Any, before: Vector, after: Vector, length: Any, over: Vector
) -> tuple[Vector, Vector, Any]:
    """Gradients over both tangents and the length of what has the gradient `over` a cell's closing."""
    facing, closing = _facing(xp, before, after), dot(over, cell_closing(xp, before, after, length))
    straight, turning = times(2 / (facing * length), over), where(xp, facing > _LEAST_FACING, closing / facing, 0.0)
    return (
        minus(times(-1.0, straight), times(turning, after)),
        minus(straight, times(turning, before)),
        -closing / length,
    )


def cell_closing_reach(xp: Any, before: Vector, after: Vector, length: Any) -> Any:
    """How much `cell_closing` changes over what either tangent does [1/m]."""
    return 2 / (_facing(xp, before, after) * length)


def node_closing(before: Vector, after: Vector, tangent: Vector) -> Vector:
    """How far a bend closes at a node, of the cells on both sides [1/m], within its section; the sharper counts more.

    The mean, weighted by the squares of how sharp each is: of one bent and one straight cell it is the bent one, with
    which the cross-section must not collide.
    """
    mean = _sharper(before, after)
    return minus(mean, times(dot(mean, tangent), tangent))


def _sharper(before: Vector, after: Vector) -> Vector:
    a, b = dot(before, before), dot(after, after)
    return times(1 / (a + b + TINY), add(times(a, before), times(b, after)))


def node_closing_gradient(
    before: Vector, after: Vector, tangent: Vector, over: Vector
) -> tuple[Vector, Vector, Vector]:
    """Gradients over both cells and the tangent of what has the gradient `over` a node's closing."""
    a, b, mean = dot(before, before), dot(after, after), _sharper(before, after)
    along = dot(over, tangent)
    turning = minus(times(-along, mean), times(dot(mean, tangent), over))
    over = minus(over, times(along, tangent))
    first = add(times(2 * dot(over, minus(before, mean)), before), times(a, over))
    last = add(times(2 * dot(over, minus(after, mean)), after), times(b, over))
    share = 1 / (a + b + TINY)
    return times(share, first), times(share, last), turning


def node_closing_rate(
    before: Vector, after: Vector, tangent: Vector, rate_before: Vector, rate_after: Vector, tangent_rate: Vector
) -> Vector:
    """Rate of `node_closing`, given those of the cells and the tangent."""
    a, b, mean = dot(before, before), dot(after, after), _sharper(before, after)
    first = add(times(2 * dot(before, rate_before), minus(before, mean)), times(a, rate_before))
    last = add(times(2 * dot(after, rate_after), minus(after, mean)), times(b, rate_after))
    rate = times(1 / (a + b + TINY), add(first, last))
    along = dot(rate, tangent) + dot(mean, tangent_rate)
    return minus(rate, add(times(along, tangent), times(dot(mean, tangent), tangent_rate)))


def flattened_share(xp: Any, now: Any, rest: Any) -> tuple[Any, Any, Any]:
    """By which share a section is flattened, and its derivatives over both arguments.

    With u how far a bend closes times the lumen's half-width (at 1 the wall on the inside meets the next section) and
    u_0 the same at rest, a section that keeps q = 1 - s of its width there closes u q = u_0 + c h((u - u_0) / c), where
    c = 1 - u_0 is the room that was left and h(x) = 1 - 1 / (1 + x + x^2 + x^3) = x - x^4 + ...: as much as the bend at
    first, never all. That sections flatten at all is Brazier's (1927); that they do so only as far as they must is an
    engineering choice.

    Args:
        xp: numpy or jax.numpy.
        now: u [1].
        rest: u_0, from 0 to u [1].
    """
    room = xp.maximum(1 - rest, _LEAST_ROOM)
    x = (now - rest) / room
    left = 1 / (1 + x + x * x + x * x * x)
    # x - h(x) and its slope, without differences of what is nearly the same.
    cube = x * x * x
    missing, slope = x * cube * left, cube * (4 + 3 * x + 2 * x * x + cube) * left * left
    per = 1 / now
    share = room * missing * per
    narrower = where(xp, 1 - rest > _LEAST_ROOM, -1.0, 0.0)
    return share, (slope - share) * per, (narrower * missing - slope * (1 + x * narrower)) * per


def flattening(xp: Any, closing: Vector, rest: Vector, width: Any) -> tuple[Any, Vector]:
    """By which share a section is flattened, and in which direction.

    Args:
        xp: numpy or jax.numpy.
        closing: of its node [1/m].
        rest: the same at rest, turned with the section.
        width: from the axis to where no wall is further [m].
    """
    share, _, _, across = _flattening(xp, closing, rest, width)
    return share, across


def _flattening(xp: Any, closing: Vector, rest: Vector, width: Any) -> tuple[Any, Any, Any, Vector]:
    """`flattening`, and derivatives over how far the bend closes now and at rest; that at rest 0 where it is bound."""
    size = norm(xp, closing)
    across = times(1 / size, closing)
    now, before = width * size, width * dot(rest, across)
    share, over_now, over_rest = flattened_share(xp, now, xp.minimum(xp.maximum(before, 0.0), now))
    bound = where(xp, before > 0, where(xp, before < now, 1.0, 0.0), 0.0)
    return share, over_now, bound * over_rest, across


def flattening_reach(xp: Any, closing: Vector, rest: Vector, width: Any) -> Any:
    """Bound of how far a section's wall moves over how far it is from the axis [1] and what the closing changes [m]."""
    share, over_now, _, _ = _flattening(xp, closing, rest, width)
    return width * over_now + 2 * share / norm(xp, closing)


def flattening_rate(
    xp: Any, closing: Vector, rest: Vector, width: Any, closing_rate: Vector, rest_rate: Vector
) -> tuple[Any, Vector]:
    """Rates of `flattening`."""
    _, over_now, over_rest, across = _flattening(xp, closing, rest, width)
    turning = unit_rate(across, norm(xp, closing), closing_rate)
    before = dot(rest_rate, across) + dot(rest, turning)
    return width * (over_now * dot(across, closing_rate) + over_rest * before), turning


def flattening_gradient(
    xp: Any, closing: Vector, rest: Vector, width: Any, couples: tuple[Vector, Vector, Vector]
) -> tuple[Vector, Vector]:
    """Gradients over `closing` and `rest` of the work of forces f on turned vectors w that are then flattened.

    Args:
        xp: numpy or jax.numpy.
        closing: as in `flattening`.
        rest: as there.
        width: as there.
        couples: rows of the sum of f w^T [N m].
    """
    share, over_now, over_rest, across = _flattening(xp, closing, rest, width)
    size = norm(xp, closing)
    rows = dot(couples[0], across), dot(couples[1], across), dot(couples[2], across)
    columns = add(add(times(across[0], couples[0]), times(across[1], couples[1])), times(across[2], couples[2]))
    both = dot(across, rows)
    turning = add(times(-share, add(rows, columns)), times(-both * over_rest * width, rest))
    over_closing = add(times(-both * over_now * width, across), unit_rate(across, size, turning))
    return over_closing, times(-both * over_rest * width, across)


def carried(section: Section, v: Vector) -> Vector:
    """A vector of a cross-section at rest, as the section is now turned and flattened."""
    real, part, flat, across = section
    return flattened(flat, across, turned(real, part, v))


def flattened(flat: Any, across: Vector, v: Vector) -> Vector:
    """A turned vector with its section flattened; the map is symmetric, so it takes forces back as well."""
    return minus(v, times(flat * dot(across, v), across))


def carried_back(section: Section, v: Vector) -> Vector:
    """The vector of the cross-section at rest that `carried` brings there."""
    real, part, flat, across = section
    return turned_back(real, part, add(v, times(flat / (1 - flat) * dot(across, v), across)))


def carried_rate(section: Section, rates: tuple[Vector, Any, Vector], v: Vector) -> Vector:
    """Rate of `carried` of a vector that itself does not change.

    Args:
        section: as it is.
        rates: its angular velocity, and the rates of how it is flattened.
        v: the vector.
    """
    real, part, flat, across = section
    spin, flat_rate, across_rate = rates
    now = turned(real, part, v)
    along = dot(across, now)
    aside = add(times(flat_rate * along + flat * dot(across_rate, now), across), times(flat * along, across_rate))
    return minus(flattened(flat, across, cross(spin, now)), aside)


def section_gradient(
    xp: Any,
    section: Section,
    tangent: Vector,
    closings: tuple[Vector, Vector],
    closing_rest: Vector,
    width: Any,
    couples: tuple[Vector, Vector, Vector],
) -> tuple[Vector, Any, Vector, Vector]:
    """What forces f on vectors v of a cross-section do to it: the transpose of `carried_rate`.

    Args:
        xp: numpy or jax.numpy.
        section: as it is now.
        tangent: of the axis there.
        closings: of the cells before and after [1/m].
        closing_rest: of the node at rest [1/m].
        width: as in `flattening` [m].
        couples: rows of the sum of f v^T [N m].

    Returns:
        Gradient of their work over the tangent, torque about it on the section [N m], and gradients
        over the closings of the cells before and after.
    """
    real, part, flat, across = section
    now = turned(real, part, couples[0]), turned(real, part, couples[1]), turned(real, part, couples[2])
    closing, before = node_closing(closings[0], closings[1], tangent), turned(real, part, closing_rest)
    over, over_rest = flattening_gradient(xp, closing, before, width, now)
    along = times(flat, add(add(times(across[0], now[0]), times(across[1], now[1])), times(across[2], now[2])))
    x, y, z = (
        minus(now[0], times(across[0], along)),
        minus(now[1], times(across[1], along)),
        minus(now[2], times(across[2], along)),
    )
    torque = add((z[1] - y[2], x[2] - z[0], y[0] - x[1]), cross(before, over_rest))
    first, last, leaning = node_closing_gradient(closings[0], closings[1], tangent, over)
    return add(cross(torque, tangent), leaning), dot(torque, tangent), first, last


def taken_back(
    xp: Any,
    offset: Vector,
    stretch: Any,
    along: tuple[Vector, Vector],
    closings: tuple[Vector, Vector],
    before: Section,
    after: Section,
    share: Any,
) -> Vector:
    """Where a point stands from its place on the axis at rest, given where it stands from the axis now [m].

    The sections' map is undone by its inverses at both nodes, once more for what they left. What the point is ahead of
    its place along the axis is undone by how much arc length there is on its side of the bend, now and at rest.

    Args:
        xp: numpy or jax.numpy.
        offset: from the axis now [m].
        stretch: length of the edge there over that at rest [1].
        along: directions of the axis at rest at both nodes.
        closings: of the cell at rest and now [1/m].
        before: section of the node before.
        after: of the node after.
        share: of the way between the nodes [1].
    """
    back = between(carried_back(before, offset), carried_back(after, offset), share)
    left = minus(offset, between(carried(before, back), carried(after, back), share))
    back = add(back, between(carried_back(before, left), carried_back(after, left), share))
    way = between(along[0], along[1], share)
    way = times(1 / norm(xp, way), way)
    return add(back, times(lengthening(xp, offset, back, stretch, closings) * dot(back, way), way))


def lengthening(xp: Any, offset: Vector, back: Vector, stretch: Any, closings: tuple[Vector, Vector]) -> Any:
    """By how much of itself what is along the axis beside a point was longer at rest than it is now [1].

    Args:
        xp: numpy or jax.numpy.
        offset: of the point from the axis now [m].
        back: the same at rest [m].
        stretch: length of the edge there over that at rest [1].
        closings: of the cell at rest and now [1/m].
    """
    inner = xp.maximum(1 - dot(closings[1], offset), _LEAST_JACOBIAN)
    return xp.maximum(1 - dot(closings[0], back), _LEAST_JACOBIAN) / (xp.maximum(stretch, SHORTEST) * inner) - 1


def touched(
    xp: Any, depth: Any, inwards: Vector, radius: Any, before: Section, after: Section, share: Any
) -> tuple[Any, Vector, Vector]:
    """Depth of a sphere in the wall as it is now [m], the wall's normal, and where the sphere's surface is.

    The last is seen from the sphere's middle and taken back to rest [m].

    Distances shrink where sections are flattened, and the sphere does not: where they keep g along the normal, its
    middle is g times as far behind the shrunk surface (`haustra.models.wall.lumen_table`), and its outside 1 - g radii
    deeper.

    Args:
        xp: numpy or jax.numpy.
        depth: in the colon at rest [m].
        inwards: normal there.
        radius: of the sphere [m].
        before: section of the node before.
        after: of the node after.
        share: of the way between the nodes [1].
    """
    normal = between(carried_normal(before, inwards), carried_normal(after, inwards), share)
    size = norm(xp, normal)
    kept = 1 / xp.maximum(size, 1.0)
    normal = times(1 / size, normal)
    lever = times(-radius, between(carried_back(before, normal), carried_back(after, normal), share))
    return kept * depth + (1 - kept) * radius, normal, lever


def held_at(offset: Vector, surface: Vector, along: tuple[Vector, Vector], share: Any) -> Vector:
    """Where a sphere holds on to the wall of the section it is looked up in, from the axis there, at rest [m].

    A sphere that is ahead of the place where it is looked up, as one on a shaft may be in a colon that is packed on it
    (`haustra.models.wall.threads`), holds on to the section there, not to what would be ahead of it: of a colon that is
    packed to a third, what is ahead would be three times as far at rest, and turn with the section as on an arm.

    Args:
        offset: of the sphere's middle from the axis at rest [m].
        surface: from there to its surface, at rest [m].
        along: directions of the axis at rest at the nodes before and after.
        share: of the way between them [1].
    """
    way = between(along[0], along[1], share)
    return add(minus(offset, times(dot(offset, way) / dot(way, way), way)), surface)


def carried_normal(section: Section, normal: Vector) -> Vector:
    """Normal of a surface of the colon at rest, across its image; as long as distances along it have shrunk."""
    real, part, flat, across = section
    now = turned(real, part, normal)
    return add(now, times(flat / (1 - flat) * dot(across, now), across))


PARTS = (
    turned,
    turned_back,
    shortest_turn,
    turn_after,
    brought_along,
    twisted,
    twist,
    cell_closing,
    _facing,
    cell_closing_rate,
    cell_closing_gradient,
    cell_closing_reach,
    node_closing,
    _sharper,
    node_closing_gradient,
    node_closing_rate,
    flattened_share,
    flattening,
    _flattening,
    flattening_reach,
    flattening_rate,
    flattening_gradient,
    carried,
    flattened,
    carried_back,
    carried_rate,
    section_gradient,
    lengthening,
    taken_back,
    touched,
    held_at,
    carried_normal,
)
"""What numba is to compile."""
