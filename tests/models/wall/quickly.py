"""What makes tests of laws quick: laws in JAX compiled as a whole, and long ways to rest in compiled loops."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from haustra.models.wall import moving_colon
from haustra.models.wall.compiled import loops
from haustra.models.wall.mesentery import Mesentery
from haustra.models.wall.moving_colon import AxisShape

_OPTIONS = {"xla_backend_optimization_level": 0, "xla_llvm_disable_expensive_passes": True}


def jitted(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a function without most of XLA's optimisations, since it is called once."""
    return jax.jit(function, compiler_options=_OPTIONS)


def crept(own: Mesentery, steps: int, step: float, force: np.ndarray | None = None) -> np.ndarray:
    """Displacements of one world's nodes [m] after steps [s] of the compiled law, under forces on them (nodes, 3) [N].

    `test_compiled_loops_are_the_law` holds it against numpy's. Nobody breathes, and loops do not touch.
    """
    count, world = own.nodes.shape[1], np.zeros(1, int)
    # A force right at the anus counts as before it.
    arcs = np.maximum(np.arange(count)[None] * own.spacing[:, None], 1e-9)
    pressed = np.zeros((1, count, 3)) if force is None else force[None]
    given = arcs, np.zeros_like(own.nodes), pressed, np.zeros((1, count, 2))
    sizes = (count - 1, 3), (count - 1,), (count, 3), (count,), (count, 4), (count - 1, 3), (count,), (count, 3)
    shape = AxisShape(*(np.zeros((1, *size)) for size in sizes))
    now, partners, drawn = moving_colon.at_rest(np, own, 1, float), np.full((1, count), -1), np.zeros((1, count, 4))
    for _ in range(steps):
        loops().step_axis(own, world, *now, shape, *given, step, np.zeros(1), partners, np.zeros(1), drawn)
    return now.pose[0, :, :3]
