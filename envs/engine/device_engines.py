"""The engines that step many scopes on JAX's device, by name."""

from typing import TYPE_CHECKING

from haustra.envs.engine.warp_setup import use_warp
from haustra.errors import InvalidOptionError

if TYPE_CHECKING:
    from haustra.envs.engine.scope_worlds import ScopeWorlds

DEVICE_ENGINES = ("mjx-jax", "mjx-warp")
"""A chain and a wall in JAX; MuJoCo's own dynamics and contacts by MuJoCo Warp, through MJX."""


def device_engine(name: str) -> "type[ScopeWorlds]":
    """The engine of that name.

    Raises:
        InvalidOptionError: when there is none.
        MissingDependencyError: when what it computes with is not installed.
    """
    if name == "mjx-jax":
        from haustra.envs.engine.scope_worlds import ScopeWorlds

        return ScopeWorlds
    if name == "mjx-warp":
        use_warp()  # first: without Warp, MJX says so on stdout
        from haustra.envs.engine.warp_scopes import WarpScopes

        return WarpScopes
    raise InvalidOptionError(f"Engine '{name}' is not known. Known: native, {', '.join(DEVICE_ENGINES)}.")
