"""Newton's method with backtracking, for equilibria."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from haustra.errors import HaustraError

_LARGEST_STEP = 0.5
"""No joint moves further in one iteration [rad]: beyond it the tangent says nothing about the chain's shape."""

_SHORTEST = 1 / 64
"""Backtracking stops here: a full step of a wrong tangent is worse than a short one."""


class NoEquilibriumError(HaustraError):
    """Newton's method found no equilibrium within its iterations."""


@dataclass(frozen=True)
class Equilibrium:
    """A configuration in which all forces balance."""

    qpos: Float[np.ndarray, " q"]
    """Generalised positions [m, rad]."""
    iterations: int
    residual: float
    """Largest force out of balance over the force scale given [1]."""


Evaluate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Force out of balance (elastic less applied) and its derivative, at a configuration."""


def find_equilibrium(
    evaluate: Evaluate,
    start: Float[np.ndarray, " q"],
    *,
    scale: float,
    tolerance: float = 1e-9,
    most_iterations: int = 60,
) -> Equilibrium:
    """Follow Newton's method from `start` until forces balance to `tolerance` times `scale`.

    Raises:
        NoEquilibriumError: when they do not within `most_iterations`.
    """
    qpos = np.array(start, dtype=float)
    force, tangent = evaluate(qpos)
    residual = np.inf
    for iteration in range(most_iterations):
        residual = float(np.abs(force).max()) / scale
        if residual < tolerance:
            return Equilibrium(qpos=qpos, iterations=iteration, residual=residual)
        step = -np.linalg.solve(tangent, force)
        part = min(1.0, _LARGEST_STEP / max(float(np.abs(step).max()), 1e-300))
        while True:
            new_force, new_tangent = evaluate(qpos + part * step)
            if np.linalg.norm(new_force) < (1 - 0.1 * part) * np.linalg.norm(force) or part < _SHORTEST:
                break
            part /= 2
        qpos, force, tangent = qpos + part * step, new_force, new_tangent
    raise NoEquilibriumError(
        f"No equilibrium within {most_iterations} iterations (residual {residual:.1e}): ramp the load up in steps."
    )
