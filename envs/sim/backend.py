"""What steps scopes: the interfaces that tasks, runs and studies know."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, Protocol, runtime_checkable

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.sim.conditions import Conditions, Snapshot
from haustra.envs.sim.gas import GasWorlds, RunGas
from haustra.envs.sim.state import Controls, Readings
from haustra.models.anatomy.colon import Colon
from haustra.models.scene import Scene
from haustra.models.wall.lumen_table import Tables
from haustra.models.wall.piece_wall import Blocks


class AbstractBackend(ABC):
    """Many scopes that are stepped together, each in a colon of its own; places are seen from the colons' entries."""

    name: ClassVar[str]
    """What it is called, of `haustra.envs.sim.capabilities.BACKENDS`."""
    on_device: bool
    """Whether it computes where JAX does, or on a GPU: rays of sight are then followed by JAX, where that is."""
    traces_pictures: ClassVar[bool]
    """Whether depth pictures are traced to the lumen's triangles by MuJoCo Warp, instead of followed in its table."""

    scene: Scene
    """Scope and options, with wall law 'table'."""
    tables: Tables
    """The colons, seen from their entries and stacked."""
    worlds: int
    """How many scopes."""
    gas: GasWorlds | None = None
    """What fills the worlds' colons, where the scene has gas."""

    @abstractmethod
    def reset(self, worlds: Int[np.ndarray, " reset"], case: Int[np.ndarray, " reset"], conditions: Conditions) -> None:
        """Lay the scopes of some worlds straight, tips at the start depth, in the colons of those numbers.

        Raises:
            UnsupportedSceneError: when the backend cannot honour a condition.
        """

    @abstractmethod
    def step(self, inputs: Controls, count: int) -> Bool[np.ndarray, " worlds"]:
        """Advance all worlds by `count` time steps; False for those that have diverged, which stand still from then.

        Raises:
            InvalidOptionError: when inputs are not of the shapes of this many worlds.
        """

    @abstractmethod
    def read(self) -> Readings:
        """What can be read off at the end of the last step.

        Where MuJoCo steps, places and forces of the wall are those at the beginning of its last time step.
        """

    @property
    @abstractmethod
    def displacement(self) -> Float[Any, "worlds nodes 7"] | None:
        """Shift [m] and turn of the colons' axes from rest, where the backend has them; None for fixed colons."""

    @abstractmethod
    def way_ahead(self, distances: Float[np.ndarray, " places"]) -> Float[np.ndarray, "worlds places 3"]:
        """Places of the centreline those distances [m] ahead of the tip, where they are now, from the entry [m]."""

    @abstractmethod
    def positions(self) -> Float[np.ndarray, "worlds joints"]:
        """Joint positions of all scopes, as MuJoCo counts them [m, rad]."""

    @abstractmethod
    def snapshot(self, world: int) -> Snapshot:
        """Where one world is now.

        Raises:
            UnsupportedSceneError: when the backend keeps none.
        """

    @abstractmethod
    def restore(self, world: int, snapshot: Snapshot) -> None:
        """Put one world, which was reset to the same colon, where another was.

        Raises:
            UnsupportedSceneError: when the backend keeps no snapshots.
        """

    @abstractmethod
    def world_data(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one world as MuJoCo's own values, to draw or to check."""

    @abstractmethod
    def close(self) -> None:
        """End what is held open."""


@runtime_checkable
class SingleBackend(Protocol):
    """One scene being stepped: on MuJoCo's CPU engine, growing there, or in JAX. Arrays have no axis of worlds."""

    @property
    def name(self) -> str:
        """Its name, of `haustra.envs.sim.capabilities.BACKENDS`."""
        ...

    @property
    def added(self) -> Sequence[float]:
        """When shaft was added to the scene [s]."""
        ...

    @property
    def scene(self) -> Scene:
        """What is stepped."""
        ...

    @property
    def qpos(self) -> Float[np.ndarray, " positions"]:
        """Generalised positions [m, rad]."""
        ...

    @property
    def ctrl(self) -> Float[np.ndarray, " actuators"]:
        """Controls of the last step [m/s, rad/s, N, 1]."""
        ...

    @property
    def gas(self) -> RunGas | None:
        """What fills the colon, where the scene has gas."""
        ...

    def step(self, inputs: Controls, count: int) -> bool:
        """Advance by `count` time steps; False when the simulation has diverged."""
        ...

    def read(self) -> Readings:
        """What can be read off."""
        ...

    def shape(self) -> Float[np.ndarray, "nodes 3"]:
        """Points along the scope's axis [m]."""
        ...

    def colon(self) -> Colon:
        """The colon as it lies now."""
        ...

    def mocap(self, blocks: Blocks) -> tuple[Float[np.ndarray, "blocks 3"], Float[np.ndarray, "blocks 4"]]:
        """Where these blocks of the wall are [m], and how they are turned, as quaternions; none in a fixed colon."""
        ...
