"""Backends of many worlds by their names; only the one that is asked for is imported."""

from typing import Any

from haustra.envs.sim.backend import AbstractBackend
from haustra.envs.sim.device_backends import require_device_backend
from haustra.models.scene import Scene
from haustra.models.wall.lumen_table import Tables


def backend_of(name: str) -> type[AbstractBackend]:
    """The backend of many worlds of that name: 'native', 'linear', 'jax' or 'warp'.

    Raises:
        InvalidOptionError: when there is none.
        MissingDependencyError: when what it computes with is not installed.
    """
    if name == "native":
        from haustra.envs.sim.native_batch import NativeBackend

        return NativeBackend
    if name == "linear":
        from haustra.envs.sim.linear.backend import LinearBackend

        return LinearBackend
    require_device_backend(name)
    from haustra.envs.sim.jax_setup import share_memory, use_jax

    share_memory()
    use_jax()
    from haustra.envs.sim.jax_backends import JaxBackend, WarpBackend

    return JaxBackend if name == "jax" else WarpBackend


def load_backend(name: str, scene: Scene, tables: Tables, *, worlds: int, threads: int = 1) -> AbstractBackend:
    """Many worlds of a backend.

    Args:
        name: as for `backend_of`.
        scene: scope and options, built with wall_law "table" for any of the colons.
        tables: the colons, seen from their entries (`LumenTable.seen_from`) and stacked.
        worlds: how many.
        threads: of the CPU; what computes on JAX's device has its own.

    Raises:
        InvalidOptionError: when there is no backend of that name.
        MissingDependencyError: when what it computes with is not installed.
        UnsupportedSceneError: when the scene has what the backend cannot honour.
    """
    kind: Any = backend_of(name)
    own = {} if kind.on_device else {"threads": threads}
    return kind(scene, tables, worlds=worlds, **own)
