"""A sprung chain under dead loads: its static shape."""

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.scripts.bench.reference.chain import Load, SerialChain
from haustra.scripts.bench.reference.newton import Equilibrium, NoEquilibriumError, find_equilibrium

_FINEST_RAMP = 1 / 64
"""Smallest part of the load that is added at once before giving up."""


def static_shape(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    *,
    loads: Sequence[Load] = (),
    gravity: Float[np.ndarray, "3"] | None = None,
    start: Float[np.ndarray, " q"] | None = None,
) -> Equilibrium:
    """Equilibrium of joint springs, weight and dead loads; `data` is left there.

    The whole load is tried at once from `start` (at rest when None); where Newton's method fails, it is ramped up.

    Args:
        model: a single chain of sprung hinges.
        data: its state; overwritten.
        loads: forces and moments on bodies.
        gravity: acceleration [m/s^2]; the model's own when None.
        start: where to start from [rad].

    Raises:
        NoEquilibriumError: when even small increments of the load find none.
    """
    chain = SerialChain(model)
    weight = model.opt.gravity.copy() if gravity is None else np.asarray(gravity, dtype=float)
    qpos = chain.rest.copy() if start is None else start

    def evaluate(part: float):
        scaled = [Load(load.body, load.point, part * load.force, part * load.moment) for load in loads]

        def at(configuration: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            chain.place(data, configuration)
            value, slope = chain.forces(data, scaled, part * weight)
            _, torque, stiffness = chain.springs(configuration)
            return torque - value, np.diag(stiffness) - slope

        return at

    scale = float(chain.stiffness.max())
    done, increment, iterations, residual = 0.0, 1.0, 0, np.inf
    while done < 1:
        part = min(1.0, done + increment)
        try:
            found = find_equilibrium(evaluate(part), qpos, scale=scale)
        except NoEquilibriumError:
            increment /= 4
            if increment < _FINEST_RAMP:
                raise
            continue
        qpos, done, iterations = found.qpos, part, iterations + found.iterations
        residual = found.residual
    return Equilibrium(qpos=qpos, iterations=iterations, residual=residual)
