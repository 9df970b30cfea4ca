"""Small things that backends, drivers and studies in JAX do with arrays of many worlds."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Bool

from haustra.models.wall.lumen_table import Tables


def on_device(tables: Tables, kind: Any = jnp.float32) -> Tables:
    """Tables on JAX's default device, their real numbers in that precision."""
    return jax.tree.map(lambda part: jnp.asarray(part, kind if part.dtype.kind == "f" else None), tables)


def tree_where(which: Bool[Any, " worlds"], new: Any, old: Any) -> Any:
    """New values in the worlds that are marked, old ones in the others: arrays, or trees of them, worlds first."""
    return jax.tree.map(lambda a, b: jnp.where(which.reshape(-1, *[1] * (a.ndim - 1)), a, b), new, old)
