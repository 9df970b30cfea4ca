"""How the wall's force grows with the depth of what presses on it: one function a law, chosen by a scene by its name.

A law says which linear spring touches it at a depth d: how deep that spring would be pressed there, and its stiffness,
so that their product is the force E(d), and the stiffness its slope E'(d). That is all an implicit step needs, from
`haustra.models.wall.law` as from MuJoCo's contacts, whose spring is linear within a step. To add a law, write it here,
name it in `ELASTICITIES`, and put its numbers into assets/numbers/contact.toml.

A law is written for numbers, arrays of numpy or JAX, and values of a program of linear time, with `xp`. It is no law of
places in the lumen, where d < 0 and it is to return what it was given; and its slope is bounded, which keeps a step of
any depth finite.
"""

from collections.abc import Callable
from math import log
from typing import Any, TypeAlias

import numpy as np
from jaxtyping import Float

from haustra.assets import asset
from haustra.quantity import load_quantities

Elasticity: TypeAlias = Callable[[Any, Any, Any], tuple[Any, Any]]
"""A law of (xp, depth [m], stiffness K at no depth [N/m]): depth [m] and stiffness [N/m] of the spring that touches."""

_NUMBERS = load_quantities(asset("numbers/contact.toml"))
_STIFFENING = _NUMBERS["contact.stiffening"].value
_STEEPEST = _NUMBERS["contact.steepest"].value

_THROUGH = 1.0
"""Deeper than any wall is pressed [m]; engineering choice: the diameter of ten colons."""
_CLOSE = 1e-12
"""Tolerance of a force whose depth is looked for, over the largest [1]."""
_TRIES = 60
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def linear(xp: Any, depth: Any, stiffness: Any) -> tuple[Any, Any]:
    """Hooke's law, E = K d."""
    return depth, stiffness


def exponential(xp: Any, depth: Any, stiffness: Any) -> tuple[Any, Any]:
    """Fung's law of soft tissue, dE/dd = K + b E, so E = K (exp(b d) - 1) / b; linear from r K on.

    Fung 1967, Am J Physiol 213:1532, of mesentery in tension; here of a wall that is pressed, with b and r assumed.
    """
    into = xp.clip(depth, 0.0, log(_STEEPEST) / _STIFFENING)
    steeper = xp.exp(_STIFFENING * into)
    return depth - into + (1 - 1 / steeper) / _STIFFENING, stiffness * steeper


ELASTICITIES: dict[str, Elasticity] = {"linear": linear, "exponential": exponential}
"""Laws by the names that scenes choose them by."""
LINEAR = "linear"
"""The law that every wall honours."""


def stiffest(name: str, stiffness: Any) -> Any:
    """Slope that a law ends with [N/m], of that at no depth."""
    return ELASTICITIES[name](np, np.full(np.shape(stiffness), _THROUGH), stiffness)[1]


def depth_under(name: str, force: Float[np.ndarray, "..."], stiffness: Any) -> Float[np.ndarray, "..."]:
    """Depth at which a wall presses back with a force [m], by Newton's method: the inverse of a law.

    Args:
        name: of the law.
        force: E [N].
        stiffness: K at no depth [N/m].
    """
    law, depth = ELASTICITIES[name], np.asarray(force / stiffness)
    for _ in range(_TRIES):
        bent, firm = law(np, depth, stiffness)
        missing = force - firm * bent
        depth = np.asarray(depth + missing / firm)
        if np.abs(missing).max(initial=0.0) <= _CLOSE * np.abs(force).max(initial=0.0):
            break
    return depth


def stored_energy(name: str, depth: Float[np.ndarray, "..."], stiffness: Any) -> Float[np.ndarray, "..."]:
    """Energy that a wall holds which is pressed so deep [J]: the integral of E from no depth on.

    Args:
        name: of the law.
        depth: d, not negative [m].
        stiffness: K at no depth [N/m].
    """
    into, stiffness = 0.5 * (1 + _PLACES) * np.asarray(depth)[..., None], np.asarray(stiffness)[..., None]
    bent, firm = ELASTICITIES[name](np, into, stiffness)
    return 0.5 * depth * ((firm * bent) @ _WEIGHTS)
