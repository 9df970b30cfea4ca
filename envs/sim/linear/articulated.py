"""Articulated-body recursion for one link: inertia that a wall and a time step may be part of, hinge by hinge.

A step by backward Euler solves (M + h D) a = tau, where D holds what damps joints and what damps places of links. A
place's damping C adds h J^T C J, which has the form of an inertia of that link, and a joint's adds to the diagonal. So
the recursion of Featherstone (2008, chapter 7) solves the very same system, with the inertia of each link and what
damps it summed, and nothing else changed. Velocity and gravity enter as a wrench on each link (docs/decisions/linear.md
has the proof).

Vectors are tuples (`haustra.models.wall.vectors`), along the axes of the world; each link's point of reference is its
own origin, so that single precision meets no long levers.
"""

from typing import Any, NamedTuple

from haustra.models.wall.vectors import Vector, add, cross, dot, minus, times


class Inertia(NamedTuple):
    """Wrench over acceleration, (torque, force) over (angular, linear): [[a, b], [b^T, m]], with a and m symmetric."""

    a: tuple[Any, ...]
    """xx, xy, xz, yy, yz, zz [kg m^2]."""
    b: tuple[Any, ...]
    """Rows one after the other [kg m]."""
    m: tuple[Any, ...]
    """xx, xy, xz, yy, yz, zz [kg]."""


def symmetric(x: Any, y: Any, z: Any, u: Vector, v: Vector) -> tuple[Any, ...]:
    """A diagonal, and u v^T, which is symmetric."""
    return x + u[0] * v[0], u[0] * v[1], u[0] * v[2], y + u[1] * v[1], u[1] * v[2], z + u[2] * v[2]


def link_inertia(axis: Vector, mass: Any, centre: Any, across: Any, along: Any) -> Inertia:
    """Inertia of a link of revolution about its origin.

    Args:
        axis: its direction.
        mass: [kg].
        centre: of mass, along the axis from the origin [m].
        across: moment of inertia about the centre, across the axis [kg m^2].
        along: about the axis [kg m^2].
    """
    about = across + mass * centre * centre
    x, y, z = times(mass * centre, axis)
    zero = 0.0 * x
    a = symmetric(about, about, about, times(along - about, axis), axis)
    return Inertia(a, (zero, -z, y, z, zero, -x, -y, x, zero), (mass, zero, zero, mass, zero, mass))


def place_inertia(lever: Vector, normal: Vector, along: Any, across: Any) -> Inertia:
    """What damps a place of a link, as an inertia.

    Args:
        lever: from the link's origin to the place [m].
        normal: of the wall.
        along: time step times damping along the normal [kg].
        across: time step times damping across it [kg].
    """
    more = along - across
    turn = cross(lever, normal)
    strong, pressed = times(more, turn), times(more, normal)
    arm = times(across, lever)
    square = dot(arm, lever)
    a = symmetric(square, square, square, strong, turn)
    held = symmetric(0.0, 0.0, 0.0, arm, lever)
    x, y, z = arm
    skew = (0.0, -z, y, z, 0.0, -x, -y, x, 0.0)
    b = tuple(strong[i] * normal[j] + skew[3 * i + j] for i in range(3) for j in range(3))
    return Inertia(
        tuple(p - q for p, q in zip(a, held, strict=True)), b, symmetric(across, across, across, pressed, normal)
    )


def link_bias(
    inertia: tuple[Any, Any, Any, Any], axis: Vector, turning: Vector, moving: Vector, rates: tuple[Vector, Vector]
) -> tuple[Vector, Vector]:
    """Torque and force that a link's velocity needs, without any acceleration of joints.

    Args:
        inertia: mass, centre, across and along, as of `link_inertia`.
        axis: its direction.
        turning: its angular velocity [rad/s].
        moving: velocity of its origin [m/s].
        rates: angular and linear acceleration that velocities alone, and gravity, give its origin.
    """
    mass, centre, across, along = inertia
    from_origin = times(centre, axis)

    def momentum(about: Vector, of: Vector) -> tuple[Vector, Vector]:
        straight = times(mass, add(of, cross(about, from_origin)))
        spin = add(times(across, about), times(dot(about, axis) * (along - across), axis))
        return add(spin, cross(from_origin, straight)), straight

    spin, straight = momentum(turning, moving)
    torque, force = momentum(*rates)
    torque = add(torque, add(cross(turning, spin), cross(moving, straight)))
    return torque, add(force, cross(turning, straight))


def times_symmetric(m: tuple[Any, ...], v: Vector) -> Vector:
    """Symmetric matrix times a vector."""
    return (
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[1] * v[0] + m[3] * v[1] + m[4] * v[2],
        m[2] * v[0] + m[4] * v[1] + m[5] * v[2],
    )


def hinge_force(own: Inertia, axis: Vector) -> tuple[Vector, Vector]:
    """Torque and force of turning about an axis through the origin."""
    b = own.b
    return times_symmetric(own.a, axis), (
        b[0] * axis[0] + b[3] * axis[1] + b[6] * axis[2],
        b[1] * axis[0] + b[4] * axis[1] + b[7] * axis[2],
        b[2] * axis[0] + b[5] * axis[1] + b[8] * axis[2],
    )


def slide_force(own: Inertia, axis: Vector) -> tuple[Vector, Vector]:
    """Torque and force of moving along an axis."""
    return (dot(own.b[0:3], axis), dot(own.b[3:6], axis), dot(own.b[6:9], axis)), times_symmetric(own.m, axis)


def freed(own: Inertia, torque: Vector, force: Vector, inverse: Any) -> tuple[Inertia, Vector, Vector]:
    """Inertia that is felt through a joint which gives way: less U U^T / D; and U / D, in both parts.

    Args:
        own: what lies beyond the joint.
        torque: U, of the joint's unit acceleration.
        force: U.
        inverse: 1 / D.
    """
    turn, push = times(inverse, torque), times(inverse, force)
    a = symmetric(0.0, 0.0, 0.0, turn, torque)
    b = tuple(turn[i] * force[j] for i in range(3) for j in range(3))
    m = symmetric(0.0, 0.0, 0.0, push, force)
    less = (tuple(x - y for x, y in zip(p, q, strict=True)) for p, q in zip(own, (a, b, m), strict=True))
    return Inertia(*less), turn, push


def from_parent(own: Inertia, offset: Vector) -> Inertia:
    """Inertia about a point that lies `offset` [m] before: b' = b + [r] m, a' = a + [r] b^T - b' [r]."""
    a, b, m = own
    columns = (m[0], m[1], m[2]), (m[1], m[3], m[4]), (m[2], m[4], m[5])
    turned = [cross(offset, column) for column in columns]
    moved = tuple(b[3 * i + j] + turned[j][i] for i in range(3) for j in range(3))
    rows = [cross(offset, b[3 * i : 3 * i + 3]) for i in range(3)]
    back = [cross(moved[3 * i : 3 * i + 3], offset) for i in range(3)]
    a = tuple(a[k] + rows[j][i] - back[i][j] for k, (i, j) in enumerate(_PAIRS))
    return Inertia(a, moved, m)


_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def turned_frame(frame: tuple[Vector, Vector, Vector], local: Vector, axis: Vector, sine: Any, versine: Any) -> Any:
    """A frame by its columns, turned about an axis by Rodrigues' formula.

    Args:
        frame: columns.
        local: the axis by its components along them.
        axis: the axis itself.
        sine: of the angle.
        versine: 1 less its cosine.
    """
    # R (1 + s [n] + v (n n^T - 1)): columns mix by the local axis.
    cosine = 1.0 - versine
    mixed = []
    for i in range(3):
        after, last = (i + 1) % 3, (i + 2) % 3
        column = add(times(cosine, frame[i]), times(versine * local[i], axis))
        column = add(column, minus(times(sine * local[last], frame[after]), times(sine * local[after], frame[last])))
        mixed.append(column)
    return tuple(mixed)
