"""Names under which Gymnasium makes the environments."""

from gymnasium.envs.registration import register, registry

_WITHDRAWAL = {"task": "withdrawal", "weights": {"coverage": 100.0, "progress": 20.0}}


def register_environments() -> None:
    """Register all ids; calling it again changes nothing."""
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
        register(id="Haustra/Device-v0", entry_point="haustra.envs.tasks.device_task:DeviceEnv")
