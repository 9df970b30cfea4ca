"""A vehicle as a Gymnasium environment, so that recordings repeat where Gymnasium's users look for them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from jaxtyping import Float

from haustra.envs.console.vehicle import Vehicle
from haustra.envs.console.vehicles import make_vehicle
from haustra.envs.runs.outcome import CAECUM_MARGIN
from haustra.errors import InvalidOptionError

_WHOLE_WAY = 100.0
"""Reward for the whole colon, in proportion to the share newly reached [1]; as that of episodes."""
_UNSEEN = ("digest", "reward", "terminated", "truncated", "time")


def observed(row: Mapping[str, Any]) -> Float[np.ndarray, " entries"]:
    """What is seen: an episode's own observation, else all numbers of a row, by their names' order."""
    if "observation" in row:
        return np.asarray(row["observation"], float)
    return np.concatenate([np.ravel(np.asarray(row[name], float)) for name in sorted(row) if name not in _UNSEEN])


def observed_names(row: Mapping[str, Any]) -> list[str]:
    """Names of the entries of `observed`."""
    names = ["observation"] if "observation" in row else [name for name in sorted(row) if name not in _UNSEEN]
    return [f"{name}[{i}]" if np.size(row[name]) > 1 else name for name in names for i in range(np.size(row[name]))]


def action_space(limits: Sequence[tuple[float, float]]) -> spaces.Box:
    """Levers, then conditions, each within its limits."""
    low, high = np.array(limits, float).T
    return spaces.Box(low, high, dtype=np.float64)


def observation_space(row: Mapping[str, Any]) -> spaces.Box:
    """What is seen of rows like this."""
    return spaces.Box(-np.inf, np.inf, observed(row).shape, np.float64)


class DriveEnv(gymnasium.Env):
    """Levers and conditions of a vehicle as actions; what is read off as observations; rewards as of episodes."""

    metadata = {"render_modes": []}  # noqa: RUF012

    def __init__(self, colon: str, configuration: dict[str, Any]) -> None:
        """Make the vehicle.

        Args:
            colon: folder of the colon.
            configuration: of the vehicle (`haustra.envs.console.vehicles.make_vehicle`).
        """
        self.vehicle: Vehicle = make_vehicle(Path(colon), configuration)
        self.action_space = action_space(
            [(one.low, one.high) for one in (*self.vehicle.levers, *self.vehicle.conditions)]
        )
        self.observation_space = observation_space(self.vehicle.look().row)
        self._start, self._begun, self._best = self.vehicle.keep(), self.vehicle.now(), 0.0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin; the seed is that of an episode's draws."""
        super().reset(seed=seed)
        self.vehicle.begin(self._start, seed)
        for number in np.flatnonzero(self.vehicle.now() != self._begun):
            self.vehicle.change(self.vehicle.conditions[number].name, float(self._begun[number]))
        row = self.vehicle.look().row
        self._best = float(row["tip_arc"])
        return observed(row), {"digest": row["digest"]}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Advance by one control step.

        Raises:
            InvalidOptionError: when the action is not of the space's shape.
        """
        vehicle, levers = self.vehicle, len(self.vehicle.levers)
        action = np.asarray(action, float)
        if action.shape != self.action_space.shape:
            raise InvalidOptionError(f"The action is of shape {action.shape}: give {self.action_space.shape}.")
        wanted, now = action[levers:], vehicle.now()
        for number in np.flatnonzero(wanted != now):
            vehicle.change(vehicle.conditions[number].name, float(wanted[number]))
        sound = vehicle.step(action[:levers])
        row = vehicle.look().row
        reward, terminated = paid(row, self._best, vehicle.around.colon.centreline.length)
        self._best = max(self._best, float(row["tip_arc"]))
        return (
            observed(row),
            reward,
            terminated or not sound,
            bool(row.get("truncated", False)),
            {"digest": row["digest"]},
        )

    def close(self) -> None:
        """End the vehicle."""
        self.vehicle.close()


def paid(row: Mapping[str, Any], best: float, length: float) -> tuple[float, bool]:
    """Reward of a step, and whether it ends the episode; `best` is the largest arc length before [m]."""
    if "reward" in row:
        return float(row["reward"]), bool(row["terminated"])
    arc = float(row["tip_arc"])
    return _WHOLE_WAY * max(arc - best, 0.0) / length, arc >= length - CAECUM_MARGIN
