"""Worlds of any device that are stepped together, natively or on MuJoCo Warp, behind one interface."""

from collections.abc import Sequence
from operator import attrgetter
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.sim.capabilities import DEVICE
from haustra.envs.sim.device_native import NativeDevice
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.device_scene import DeviceScene
from haustra.models.devices.base import DeviceReadings
from haustra.models.wall.lumen_table import Tables

NAMES = ("native", "warp")
"""MuJoCo on a CPU, or MuJoCo Warp, which an NVIDIA GPU makes fast."""


@runtime_checkable
class DeviceWorlds(Protocol):
    """Worlds of one device, each in a colon, with friction and wall stiffness of its own."""

    name: str

    def reset(
        self,
        worlds: Int[np.ndarray, " reset"],
        colons: Int[np.ndarray, " reset"],
        *,
        friction: Float[np.ndarray, " reset"],
        wall_stiffness: Float[np.ndarray, " reset"],
    ) -> None:
        """Put the devices of some worlds to the anus of the colons of those numbers."""
        ...

    def step(self, commands: Float[np.ndarray, "worlds channels"], count: int) -> Bool[np.ndarray, " worlds"]:
        """Advance by `count` time steps; False for worlds that are lost, which stand still from then."""
        ...

    def read(self) -> DeviceReadings:
        """What every device can be told by, at the end of the last step."""
        ...

    def readings(self) -> dict[str, Float[np.ndarray, " worlds"]]:
        """The device's own quantities, by name."""
        ...

    @property
    def displacement(self) -> Float[np.ndarray, "worlds nodes 7"] | None:
        """Displacements of the colons' axes [m]; None where they are fixed."""
        ...


def load_device_worlds(
    name: str,
    scene: DeviceScene,
    tables: Tables,
    *,
    worlds: int = 1,
    threads: int = 1,
    starts: Sequence[float] | None = None,
) -> DeviceWorlds:
    """Worlds of a device on a backend.

    Args:
        name: of `NAMES`.
        scene: device and options.
        tables: the colons (`haustra.models.device_scene.device_tables`).
        worlds: how many.
        threads: of MuJoCo's CPU engine.
        starts: arc length of the scene's pose in each colon [m]; that of the pose when None.

    Raises:
        InvalidOptionError: when there is no backend of that name.
        MissingDependencyError: when what it computes with is not installed.
        UnsupportedSceneError: when the backend cannot honour the device.
    """
    if name not in NAMES:
        raise InvalidOptionError(f"Backend '{name}' is not known. Known: {', '.join(NAMES)}.")
    if name == "native":
        return NativeDevice(scene, tables, worlds=worlds, threads=threads, starts=starts)
    require_on_warp(scene)
    from haustra.envs.sim.jax_setup import share_memory, use_jax
    from haustra.envs.sim.warp_setup import use_warp

    share_memory()
    use_jax()
    use_warp()  # first: without Warp, MJX says so on stdout
    from haustra.envs.sim.device_warp import WarpDeviceWorlds

    return WarpDeviceWorlds(scene, tables, worlds=worlds, starts=starts)


def require_on_warp(scene: DeviceScene) -> None:
    """Refuse what Warp cannot honour of a device and its scene; Warp itself need not be there.

    Raises:
        UnsupportedSceneError: naming the field and its value (`haustra.envs.sim.capabilities.DEVICE`).
    """
    kind = scene.device.kind
    for entry in DEVICE:
        name = entry.path.removeprefix("device.")
        value = attrgetter(name)(scene.options)
        if not entry.honoured("warp", value):
            raise UnsupportedSceneError(
                f"The backend 'warp' cannot honour {entry.path} = {value!r} of a device of kind '{kind}': 'native' can."
            )
