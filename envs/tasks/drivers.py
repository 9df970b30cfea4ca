"""Who drives when no policy does: chance, a constant push, and the lumen follower."""

from typing import Protocol

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.control.follower import FollowerSettings, LumenFollower
from haustra.envs.sim.energy import Energies
from haustra.envs.sim.native import Observation
from haustra.envs.tasks.observation import Observation as Parts
from haustra.envs.tasks.scope_task import ACTIONS, ScopeTask


class Driver(Protocol):
    """Whoever chooses actions."""

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """Episodes begin in these worlds."""
        ...

    def act(self, seen: Parts) -> Float[np.ndarray, "worlds 4"]:
        """Actions for what all worlds see."""
        ...


class RandomDriver:
    """Even chances for every action, held for half a second: drawn anew at 25 Hz they would cancel out."""

    def __init__(self, task: ScopeTask, *, seed: int = 0, hold: float = 0.5) -> None:
        """Drive the worlds of a task."""
        self._task, self._random = task, np.random.default_rng(seed)
        self._every, self._count = max(1, round(hold / task.interval)), 0
        self._action = np.zeros((task.worlds, len(ACTIONS)))

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """Nothing is remembered."""

    def act(self, seen: Parts) -> Float[np.ndarray, "worlds 4"]:
        """Any action."""
        if self._count % self._every == 0:
            self._action = self._random.uniform(-1, 1, self._action.shape)
        self._count += 1
        return self._action


class PushDriver:
    """Push, and do nothing else."""

    def __init__(self, task: ScopeTask, *, push: float = 0.67) -> None:
        """Drive the worlds of a task with a constant push action: 4 cm/s."""
        self._action = np.tile([push, 0.0, 0.0, 0.0], (task.worlds, 1))

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """Nothing is remembered."""

    def act(self, seen: Parts) -> Float[np.ndarray, "worlds 4"]:
        """The push."""
        return self._action


class FollowerDriver:
    """The lumen follower of `haustra.envs.control.follower`: it knows the centreline and all wall forces."""

    def __init__(self, task: ScopeTask, *, settings: FollowerSettings | None = None) -> None:
        """Drive the worlds of a task."""
        self._task, self._settings = task, settings
        self._tip_links = task.bank.scene.cable.tip_links
        self._followers: list[LumenFollower] = [self._new(0)] * task.worlds

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """New colons, new followers."""
        for world in np.flatnonzero(worlds):
            self._followers[world] = self._new(int(self._task.case[world]))

    def act(self, seen: Parts) -> Float[np.ndarray, "worlds 4"]:
        """What each follower asks for, as actions."""
        drive, wires = self._task.config.drive, self._task.bank.design.wires
        actions = np.zeros((self._task.worlds, len(ACTIONS)))
        for world, follower in enumerate(self._followers):
            arc = float(self._task.seen.tip_arc[world])
            asked = follower.act(self._look(world), arc, self._task.interval)
            pull = (asked.pulls[:2] - asked.pulls[2:]) / wires.pull_limit
            actions[world] = [asked.push_rate / drive.push_rate, asked.roll_rate / drive.roll_rate, *pull]
        return np.clip(actions, -1, 1)

    def _new(self, case: int) -> LumenFollower:
        bank = self._task.bank
        return LumenFollower(bank.cases[case].line, bank.design, tip_links=self._tip_links, settings=self._settings)

    def _look(self, world: int) -> Observation:
        seen = self._task.seen
        return Observation(
            time=float(seen.time[world]),
            insertion=float(seen.insertion[world]),
            roll=float(seen.roll[world]),
            hand_lead=float(seen.hand_lead[world]),
            tip=seen.tip[world],
            tip_frame=seen.tip_frame[world],
            bend=seen.bend[world],
            push_force=float(seen.push_force[world]),
            torque=float(seen.torque[world]),
            pulls=np.zeros(4),
            link_forces=seen.link_forces[world],
            contacts=0,
            energies=Energies(0.0, 0.0, 0.0),
        )
