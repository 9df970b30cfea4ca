"""Who drives when no policy does: chance, a constant push or pull, the lumen follower, and a device's own driver."""

from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.control import follower
from haustra.envs.control.follower import Steering
from haustra.envs.control.laws import driver_settings
from haustra.envs.tasks.actions import ACTIONS, actions_of
from haustra.envs.tasks.device_task import DeviceTask, limits_of
from haustra.envs.tasks.observation import Observation as Parts
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.models.anatomy.surface_landmarks import inspection_number


@runtime_checkable
class Driver(Protocol):
    """Whoever chooses actions."""

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """Episodes begin in these worlds."""
        ...

    def act(self, seen: Parts) -> Float[np.ndarray, "worlds actions"]:
        """Actions for what all worlds see."""
        ...


def insufflated(task: ScopeTask, action: Float[np.ndarray, "worlds 4"]) -> Float[np.ndarray, "worlds actions"]:
    """Actions of a driver that leaves gas to the insufflator: all that it lets in below the set point, or nothing."""
    if len(actions_of(task.config)) == len(ACTIONS):
        return action
    gas = task.backend.gas
    assert gas is not None, "a gas action without gas"
    return np.column_stack([action, gas.tip_pressure < gas.set_point])


class RandomDriver:
    """Even chances for every action, held for half a second: drawn anew at 25 Hz they would cancel out."""

    def __init__(self, task: ScopeTask, *, seed: int = 0, hold: float = 0.5) -> None:
        """Drive the worlds of a task."""
        self._task, self._random = task, np.random.default_rng(seed)
        self._every, self._count = max(1, round(hold / task.interval)), 0
        self._action = np.zeros((task.worlds, len(actions_of(task.config))))

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """Nothing is remembered."""

    def act(self, seen: Parts) -> Float[np.ndarray, "worlds actions"]:
        """Any action."""
        if self._count % self._every == 0:
            self._action = self._random.uniform(-1, 1, self._action.shape)
        self._count += 1
        return self._action


class PushDriver:
    """Push, and do nothing else."""

    def __init__(self, task: ScopeTask, *, push: float = 0.67) -> None:
        """Drive the worlds of a task with a constant push action: 4 cm/s."""
        self._task, self._action = task, np.tile([push, 0.0, 0.0, 0.0], (task.worlds, 1))

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """Nothing is remembered."""

    def act(self, seen: Parts) -> Float[np.ndarray, "worlds actions"]:
        """The push."""
        return insufflated(self._task, self._action)


class PullDriver:
    """Pull back at a constant rate, wheels let go: nobody looks behind a fold."""

    def __init__(self, task: ScopeTask) -> None:
        """Drive the worlds of a task, at the rate of assets/numbers/inspection.toml."""
        pull = min(inspection_number("withdrawal_rate") / task.config.drive.push_rate, 1.0)
        self._task, self._action = task, np.tile([-pull, 0.0, 0.0, 0.0], (task.worlds, 1))

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """Nothing is remembered."""

    def act(self, seen: Parts) -> Float[np.ndarray, "worlds actions"]:
        """The pull."""
        return insufflated(self._task, self._action)


class FollowerDriver:
    """The lumen follower of `haustra.envs.control.follower`, or another driver that is a law.

    What an endoscopist asks of an assistant is left undone.
    """

    def __init__(self, task: ScopeTask, *, law: str = "follower", settings: Any = None) -> None:
        """Drive the worlds of a task, whichever backend steps them."""
        self._task = task
        self._settings = settings or driver_settings(law, moves=task.config.mesentery)
        self._steering = Steering.of(task.bank.design, self._settings)
        self._tip_links = task.bank.scene.cable.tip_links
        self._fresh = self._memory = self._settings.law().begin(np, task.worlds, np.float64)

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """New colons, new followers."""
        pairs = zip(self._fresh, self._memory, strict=True)
        self._memory = type(self._fresh)(*(np.where(worlds, new, old) for new, old in pairs))

    def did(self, action: Float[np.ndarray, "worlds actions"]) -> None:
        """What was done instead of what was proposed, where a person corrects: its law goes by what it sees."""

    def act(self, seen: Parts) -> Float[np.ndarray, "worlds actions"]:
        """What each follower asks for, as actions."""
        task, drive, own = self._task, self._task.config.drive, self._task.seen
        decision, self._memory = follower.decide(
            np,
            self._settings,
            self._steering,
            own,
            self._memory,
            time=own.time,
            arc=own.tip_arc,
            target=task.way_ahead(np.array([self._settings.look_ahead]))[:, 0],
            interval=task.interval,
            tip_links=self._tip_links,
        )
        pull = (decision.pulls[:, :2] - decision.pulls[:, 2:]) / task.bank.design.wires.pull_limit
        rates = [decision.push_rate / drive.push_rate, decision.roll_rate / drive.roll_rate]
        return insufflated(task, np.clip(np.column_stack([*rates, pull]), -1, 1))


class OwnDriver:
    """The simple driver that any device brings."""

    def __init__(self, task: DeviceTask) -> None:
        """Drive the worlds of a task."""
        self._task, self._memory = task, np.zeros(task.worlds)
        self._low, self._high = limits_of(task.device)

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """Nothing of before is remembered there."""
        self._memory = np.where(worlds, 0.0, self._memory)

    def act(self, seen: Parts) -> Float[np.ndarray, "worlds channels"]:
        """What it commands, as actions."""
        commands, self._memory = self._task.device.drive(np, self._task.seen[0], self._memory)
        return np.clip(2 * (commands - self._low) / (self._high - self._low) - 1, -1, 1)
