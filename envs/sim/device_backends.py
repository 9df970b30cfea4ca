"""The backends that step many scopes on JAX's device, by name."""

from typing import TYPE_CHECKING

from haustra.envs.sim.warp_setup import use_warp
from haustra.errors import InvalidOptionError

if TYPE_CHECKING:
    from haustra.envs.sim.scope_worlds import JaxScopes

DEVICE_BACKENDS = ("jax", "warp")
"""A chain and a wall in JAX; MuJoCo's own dynamics and contacts by MuJoCo Warp, through MJX."""


def require_device_backend(name: str) -> None:
    """Refuse a name that is none, before anything is loaded.

    Raises:
        InvalidOptionError: naming those that are known.
    """
    if name not in DEVICE_BACKENDS:
        raise InvalidOptionError(f"Backend '{name}' is not known. Known: native, {', '.join(DEVICE_BACKENDS)}.")


def device_backend(name: str) -> "type[JaxScopes]":
    """The backend of that name.

    Raises:
        InvalidOptionError: when there is none.
        MissingDependencyError: when what it computes with is not installed.
    """
    require_device_backend(name)
    if name == "jax":
        from haustra.envs.sim.scope_worlds import JaxScopes

        return JaxScopes
    use_warp()  # first: without Warp, MJX says so on stdout
    from haustra.envs.sim.warp_scopes import WarpScopes

    return WarpScopes
