"""Backends of many worlds by their names; only the one that is asked for is imported."""

from typing import Any

from haustra.envs.sim.backend import AbstractBackend
from haustra.errors import InvalidOptionError
from haustra.models.scene import Scene
from haustra.models.wall.lumen_table import Tables

NAMES = ("native", "linear", "linear-gpu", "warp")
"""MuJoCo on threads; linear time on threads, or on an NVIDIA GPU; MuJoCo Warp, which an NVIDIA GPU makes fast."""


def backend_of(name: str) -> type[AbstractBackend]:
    """The backend of many worlds of one of those `NAMES`.

    Raises:
        InvalidOptionError: when there is none.
        MissingDependencyError: when what it computes with is not installed.
    """
    if name not in NAMES:
        raise InvalidOptionError(f"Backend '{name}' is not known. Known: {', '.join(NAMES)}.")
    if name == "native":
        from haustra.envs.sim.native_batch import NativeBackend

        return NativeBackend
    if name.startswith("linear"):
        from haustra.envs.sim.linear.backend import LinearBackend

        return LinearBackend
    from haustra.envs.sim.jax_setup import share_memory, use_jax
    from haustra.envs.sim.warp_setup import use_warp

    share_memory()
    use_jax()
    use_warp()  # first: without Warp, MJX says so on stdout
    from haustra.envs.sim.warp_backend import WarpBackend

    return WarpBackend


def load_backend(name: str, scene: Scene, tables: Tables, *, worlds: int, threads: int = 1) -> AbstractBackend:
    """Many worlds of a backend.

    Args:
        name: of `NAMES`.
        scene: scope and options, built with wall_law "table" for any of the colons.
        tables: the colons, seen from their entries (`LumenTable.seen_from`) and stacked.
        worlds: how many.
        threads: of the CPU; a GPU has its own.

    Raises:
        InvalidOptionError: when there is no backend of that name.
        MissingDependencyError: when what it computes with is not installed.
        UnsupportedSceneError: when the scene has what the backend cannot honour.
    """
    kind: Any = backend_of(name)
    own = {"linear-gpu": {"device": "cuda"}, "warp": {}}.get(name, {"threads": threads})
    return kind(scene, tables, worlds=worlds, **own)
