"""The lumen follower of `haustra.envs.tasks.drivers` where JAX computes: thousands of worlds in one call."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.control.follower_worlds import Drive, Wires, WorldsFollower
from haustra.envs.sim.device_arrays import on_device, tree_where
from haustra.envs.sim.scope_values import Readings
from haustra.envs.tasks.observation import Observation
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.models.wall.lumen_table import pick


class DeviceFollowerDriver:
    """The follower's rules in single precision; the centreline ahead is interpolated instead of its next station."""

    def __init__(self, task: ScopeTask, *, settings: FollowerSettings | None = None) -> None:
        """Drive the worlds of a task, whichever engine steps them."""
        self._task = task
        design = task.bank.design
        settings = settings or FollowerSettings(straighten=task.config.mesentery)
        follower = WorldsFollower(settings, task.bank.scene.cable.tip_links)
        tables = on_device(task.bank.tables)
        wires = Wires.of(design)
        interval, drive, most = task.interval, task.config.drive, design.wires.pull_limit

        def act(case: Any, seen: Readings, time: Any, memory: Drive) -> tuple[Any, Drive]:
            hands, memory = follower.decide(wires, pick(tables, case), seen, time, memory, interval=interval)
            pull = (hands.pulls[:, :2] - hands.pulls[:, 2:]) / most
            rates = [hands.push_rate / drive.push_rate, hands.roll_rate / drive.roll_rate]
            return jnp.clip(jnp.column_stack([*rates, pull]), -1, 1), memory

        self._act = jax.jit(act)
        self._fresh = self._memory = follower.begin(task.worlds)

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """New colons, new followers."""
        self._memory = tree_where(jnp.asarray(worlds), self._fresh, self._memory)

    def act(self, seen: Observation) -> Float[np.ndarray, "worlds 4"]:
        """What each follower asks for, as actions."""
        own = self._task.seen
        names = (name for name in Readings._fields if name != "shift")
        parts = Readings(
            **{name: np.asarray(getattr(own, name), np.float32) for name in names},
            shift=getattr(self._task.engine, "shift", None),
        )
        case, time = self._task.case.astype(np.int32), own.time.astype(np.float32)
        actions, self._memory = self._act(case, parts, time, self._memory)
        return np.asarray(actions, float)
