"""What devices of many worlds measure themselves, and remember: those parts of an observation that need no rays."""

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.sim.state import Readings
from haustra.envs.tasks import observation as seen_by
from haustra.envs.tasks.actions import ACTIONS
from haustra.envs.tasks.config import TaskConfig
from haustra.models.wall import vectors

Wheels = tuple[Float[np.ndarray, " worlds"], Float[np.ndarray, " worlds"]]
"""How far the wheels of all worlds are turned, towards up and left [1]."""


class Senses:
    """Readings and actions in, parts of an observation out; the environments and policies in single runs share it."""

    def __init__(self, config: TaskConfig, interval: float, seen: Readings) -> None:
        """Begin in all worlds.

        Args:
            config: says which parts there are.
            interval: time between two actions [s].
            seen: what can be read off now.
        """
        worlds = len(seen.insertion)
        self._config, self._interval = config, interval
        self._sizes = seen_by.sizes(config)
        self._action, self._speed = np.zeros((worlds, len(ACTIONS))), np.zeros(worlds)
        self._tip_velocity = np.zeros((worlds, 3))
        self._memory = seen_by.Memory(config.memory, worlds, seen_by.measured_size(config), interval)
        self.begin(np.arange(worlds), seen, (np.zeros(worlds), np.zeros(worlds)))

    def begin(self, worlds: Int[np.ndarray, " begun"], seen: Readings, wheels: Wheels) -> None:
        """Forget in these worlds all but what is read off now; `seen` and `wheels` are those of all worlds."""
        for array in (self._action, self._speed, self._tip_velocity):
            array[worlds] = 0
        self._measure(seen, wheels)
        if self._config.memory:
            self._memory.begin(worlds, self._remembered())

    def acted(self, seen: Readings, action: Float[np.ndarray, "worlds 4"], wheels: Wheels) -> None:
        """Take in what is read off after an action of all worlds."""
        self._action = action
        self._speed = (seen.insertion - self._seen.insertion) / self._interval
        self._tip_velocity = (seen.tip - self._seen.tip) / self._interval
        self._measure(seen, wheels)
        if self._config.memory:
            self._memory.add(self._remembered())

    @property
    def parts(self) -> dict[str, np.ndarray]:
        """State, imager and recent, as far as the configuration shows them."""
        made = dict(self._measured)
        if self._config.memory:
            made["recent"] = self._memory.recent(self._remembered())
        return {name: made[name] for name in self._sizes if name in made}

    def _measure(self, seen: Readings, wheels: Wheels) -> None:
        self._seen, action = seen, tuple(self._action.T)
        measured = {"state": seen_by.state(np, seen_by.Felt.of(seen), wheels, action, self._speed)}
        if self._config.imager:
            measured["imager"] = seen_by.imager(seen_by.Placed.of(seen), vectors.of(self._tip_velocity))
        self._measured = {name: seen_by.arrayed(entries) for name, entries in measured.items()}

    def _remembered(self) -> np.ndarray:
        return np.concatenate(list(self._measured.values()), axis=1)
