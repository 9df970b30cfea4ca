"""Names under which Gymnasium makes the environments, and a function that makes one."""

from importlib.util import find_spec
from typing import Any

from haustra.errors import InvalidOptionError, MissingDependencyError

_WITHDRAWAL = {"task": "withdrawal", "weights": {"coverage": 100.0, "progress": 20.0}}


NAMES = ("Colonoscopy", "Withdrawal", "Drive", "Device")
"""Environments by name; Gymnasium's ids are Haustra/NAME-v0."""


def make_env(name: str = "Colonoscopy", *, worlds: int | None = None, **options: Any) -> Any:
    """A Gymnasium environment, or a vector environment of so many worlds.

    Args:
        name: of `NAMES`: insertion (Colonoscopy), withdrawal (Withdrawal), a drive as in the browser (Drive), or any
            device (Device).
        worlds: how many step at once; a single one, without an axis of worlds, when None.
        options: of the environment, as gymnasium.make takes them.

    Raises:
        InvalidOptionError: when there is no environment of that name.
        MissingDependencyError: without Gymnasium.
    """
    if name not in NAMES:
        raise InvalidOptionError(f"Environment '{name}' is not known. Known: {', '.join(NAMES)}.")
    if find_spec("gymnasium") is None:
        raise MissingDependencyError("Environments need gymnasium: 'pip install haustra[rl]'.")
    import gymnasium

    register_environments()
    if worlds is None:
        return gymnasium.make(f"Haustra/{name}-v0", **options)
    return gymnasium.make_vec(f"Haustra/{name}-v0", num_envs=worlds, **options)


def register_environments() -> None:
    """Register all ids; calling it again changes nothing."""
    from gymnasium.envs.registration import register, registry

    for name, options in (("Colonoscopy", {}), ("Withdrawal", _WITHDRAWAL)):
        if f"Haustra/{name}-v0" not in registry:
            register(
                id=f"Haustra/{name}-v0",
                entry_point="haustra.envs.tasks.navigation:NavigationEnv",
                vector_entry_point="haustra.envs.tasks.vector:NavigationVectorEnv",
                kwargs=options,
            )
    if "Haustra/Drive-v0" not in registry:
        register(id="Haustra/Drive-v0", entry_point="haustra.envs.console.env:DriveEnv")
    if "Haustra/Device-v0" not in registry:
        register(id="Haustra/Device-v0", entry_point="haustra.envs.tasks.device_env:DeviceEnv")
