"""Vectors as tuples of three components, numbers or arrays of numpy or JAX: numba compiles what is made of them.

A law that is written for one place with these is one law: for a number a component in a compiled loop, for arrays of
them in numpy and JAX.
"""

from typing import Any, TypeAlias

Vector: TypeAlias = tuple[Any, Any, Any]

TINY = 1e-12
"""Added to squares before their root is taken, which so has a derivative at 0."""


def of(array: Any) -> Vector:
    """Components of vectors along an array's last axis."""
    return array[..., 0], array[..., 1], array[..., 2]


def stacked(xp: Any, v: Vector) -> Any:
    """Vectors along the last axis of one array."""
    return xp.stack(v, axis=-1)


def add(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Vector, b: Vector) -> Vector:
    """Difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def times(s: Any, a: Vector) -> Vector:
    """The vector times a number."""
    return s * a[0], s * a[1], s * a[2]


def dot(a: Vector, b: Vector) -> Any:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def norm(xp: Any, a: Vector) -> Any:
    """Length, at least a millionth."""
    return xp.sqrt(dot(a, a) + TINY)


def between(a: Vector, b: Vector, share: Any) -> Vector:
    """The vector that share of the way from one to the other."""
    return add(a, times(share, minus(b, a)))


def unit_rate(unit: Vector, length: Any, rate: Vector) -> Vector:
    """Rate of v / |v|, given that of v; the map is symmetric, so it takes gradients back as well."""
    return times(1 / length, minus(rate, times(dot(unit, rate), unit)))


def where(xp: Any, condition: Any, yes: Any, no: Any) -> Any:
    """`xp.where`, of which numba makes an array of a number."""
    return xp.where(condition, yes, no)


PARTS = (add, minus, times, dot, cross, norm, between, unit_rate)
"""What numba is to compile."""
