"""Laws in JAX, compiled as a whole and as quickly as may be: they are called once."""

from collections.abc import Callable
from typing import Any

import jax

_OPTIONS = {"xla_backend_optimization_level": 0, "xla_llvm_disable_expensive_passes": True}


def jitted(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same function, without most of XLA's optimisations."""
    return jax.jit(function, compiler_options=_OPTIONS)
