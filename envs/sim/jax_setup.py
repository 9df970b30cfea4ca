"""JAX as this project uses it: there or not, on how many devices, with compiled programs kept."""

import os
from pathlib import Path
from typing import Any

from haustra.errors import MissingDependencyError, UnsupportedSceneError


def use_jax(*, devices: int = 1, cache: Path | None = None) -> list[Any]:
    """JAX's devices, at least that many.

    Args:
        devices: how many are needed.
        cache: folder in which compiled programs are kept for the next time.

    Raises:
        MissingDependencyError: when JAX is not installed.
        UnsupportedSceneError: when there are fewer devices.
    """
    try:
        import jax
    except ImportError as error:
        raise MissingDependencyError("The backend 'warp' needs JAX: pip install 'haustra[warp]'.") from error
    if cache is not None:
        jax.config.update("jax_compilation_cache_dir", str(cache))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.5)
    found = jax.devices()
    if len(found) < devices:
        raise UnsupportedSceneError(f"{devices} devices were asked for; JAX finds {len(found)} ({found[0].platform}).")
    return found[:devices]


def share_memory() -> None:
    """Let JAX take of the GPU's memory what it needs, and leave the rest to others, as PyTorch beside it.

    By itself JAX takes three quarters at its start. What a user set in XLA_PYTHON_CLIENT_PREALLOCATE stands; once JAX
    has touched a device, nothing changes any more.
    """
    os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")
