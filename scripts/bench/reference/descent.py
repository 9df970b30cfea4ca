"""Minimum of a potential energy by Newton's method with a trust region: robust where plain Newton's method is lost."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from haustra.scripts.bench.reference.newton import Equilibrium, NoEquilibriumError

Potential = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]
"""Energy [J], its gradient and its second derivative, at a configuration."""

_FIRST_SHIFT = 1e-6
_LARGEST_SHIFT = 1e12
_ROUNDING = 1e-12
"""Relative rounding of an energy that is a sum over some hundred springs."""


def find_minimum(
    potential: Potential,
    start: Float[np.ndarray, " q"],
    *,
    scale: float,
    tolerance: float = 1e-8,
    most_iterations: int = 500,
    largest_step: float = 0.5,
) -> Equilibrium:
    """Go downhill from `start` until forces balance to `tolerance` times `scale`: a stable equilibrium.

    The second derivative is shifted by a multiple of its diagonal until it is positive definite and the step lowers the
    energy as much as a tenth of what the quadratic model promises (Levenberg and Marquardt's rule).

    Args:
        potential: the energy and its derivatives.
        start: where to start.
        scale: force that counts as one [N m].
        tolerance: of the forces out of balance.
        most_iterations: give up after so many.
        largest_step: no coordinate moves further in one iteration [rad, m].

    Raises:
        NoEquilibriumError: when forces do not balance within `most_iterations`.
    """
    qpos = np.array(start, dtype=float)
    energy, force, tangent = potential(qpos)
    shift, residual = _FIRST_SHIFT, np.inf
    for iteration in range(most_iterations):
        residual = float(np.abs(force).max()) / scale
        if residual < tolerance:
            return Equilibrium(qpos=qpos, iterations=iteration, residual=residual)
        symmetric = (tangent + tangent.T) / 2
        diagonal = np.abs(np.diag(symmetric)) + 1e-9 * scale
        while True:
            try:
                step = -cho_solve(cho_factor(symmetric + shift * np.diag(diagonal)), force)
            except LinAlgError:
                shift = _raised(shift)
                continue
            promised = force @ step + 0.5 * step @ symmetric @ step
            small = np.abs(step).max() <= largest_step
            if small:
                found = potential(qpos + step)
                lowered = found[0] - energy <= 0.1 * min(promised, 0.0) + 1e-14 * abs(energy)
                # Near the minimum energies differ by less than they are rounded to; forces still tell.
                unsaid = abs(found[0] - energy) <= _ROUNDING * abs(energy)
                if lowered or (unsaid and np.abs(found[1]).max() < np.abs(force).max()):
                    break
            shift = _raised(shift)
        qpos = qpos + step
        energy, force, tangent = found
        shift = max(shift / 10, 1e-15)
    raise NoEquilibriumError(
        f"No equilibrium within {most_iterations} iterations (residual {residual:.1e}): start nearer to it."
    )


def _raised(shift: float) -> float:
    if shift > _LARGEST_SHIFT:
        raise NoEquilibriumError("No step lowers the energy: its derivatives do not fit it.")
    return 10 * shift
