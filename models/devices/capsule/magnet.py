"""Force and torque of one magnet on another, both as point dipoles.

Between dipoles m (the one that is led) and M, at the vector r from M to m of length r and direction n,

    F = 3 mu0 / (4 pi r^4) [(M.n) m + (m.n) M + (m.M) n - 5 (M.n)(m.n) n],
    B = mu0 / (4 pi r^3) [3 (M.n) n - M],   torque = m x B

(Jackson, Classical Electrodynamics, 5.6 and 5.7). Magnets that are as long as they are thick are dipoles to within some
percent from two of their lengths on (Petruska and Abbott 2013, doi 10.1109/TMAG.2012.2205014).
"""

import math
from types import ModuleType
from typing import Any

from jaxtyping import Float

PERMEABILITY = 4e-7 * math.pi
"""Magnetic permeability of free space, and to 1e-5 of tissue [N/A^2]."""


def dipole_wrench(
    xp: ModuleType,
    source: Float[Any, "worlds 3"],
    led: Float[Any, "worlds 3"],
    away: Float[Any, "worlds 3"],
) -> tuple[Float[Any, "worlds 3"], Float[Any, "worlds 3"]]:
    """Force [N] and torque [N m] on a dipole.

    Args:
        xp: numpy or jax.numpy.
        source: moment of the magnet that leads [A m^2].
        led: moment of the one that is led [A m^2].
        away: from the first to the second [m].
    """
    distance = xp.sqrt((away**2).sum(axis=1, keepdims=True))
    n = away / distance
    along, own, both = ((a * b).sum(axis=1, keepdims=True) for a, b in ((source, n), (led, n), (led, source)))
    strength = 3 * PERMEABILITY / (4 * math.pi * distance**4)
    force = strength * (along * led + own * source + (both - 5 * along * own) * n)
    field = PERMEABILITY / (4 * math.pi * distance**3) * (3 * along * n - source)
    return force, xp.cross(led, field)


def distance_for(source: float, led: float, force: Any) -> Any:
    """Distance at which magnets in line draw each other with a force [N]: 3 mu0 m M / (2 pi F) is its fourth power [m].

    Args:
        source: size of one moment [A m^2].
        led: of the other [A m^2].
        force: [N].
    """
    return (3 * PERMEABILITY * source * led / (2 * math.pi * force)) ** 0.25
