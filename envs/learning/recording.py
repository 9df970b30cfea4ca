"""The best episode of an evaluation, as states five times a simulated second: what a video is drawn from."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.envs.tasks.scope_task import ScopeTask

INTERVAL = 0.2
"""Simulated time between two states [s]."""
_COLUMNS = ("time", "tip_arc", "progress", "push_force")


@dataclass(frozen=True)
class Recording:
    """One episode."""

    number: int
    """Number of the episode, in the order of the evaluation."""
    case: int
    """Which colon of the bank."""
    qpos: Float[np.ndarray, "frames joints"]
    """Joint positions of the scope, as MuJoCo counts them."""
    time: Float[np.ndarray, " frames"]
    """Simulated time [s]."""
    tip_arc: Float[np.ndarray, " frames"]
    """Arc length of the tip [m]."""
    progress: Float[np.ndarray, " frames"]
    """Share of the way, the best so far."""
    push_force: Float[np.ndarray, " frames"]
    """Force with which the hand pushes [N]."""
    wall_force: Float[np.ndarray, " frames"]
    """Largest on a link at any step since the state before [N]."""
    displacement: Float[np.ndarray, "frames nodes 7"] | None = None
    """Displacements of the colon's axis [m], to a tenth of a millimetre; None in a colon that is fixed in space."""


class Recorder:
    """Notes states of all running episodes and keeps those of the best one that has ended."""

    def __init__(self, task: ScopeTask) -> None:
        """Watch a task's worlds."""
        self._task = task
        self._every = max(1, round(INTERVAL / task.interval))
        self._rows: list[list[np.ndarray]] = [[] for _ in range(task.worlds)]
        self._displacements: list[list[np.ndarray]] = [[] for _ in range(task.worlds)]
        self._force = np.zeros(task.worlds)
        self._rank: tuple[float, ...] = ()
        self.best: Recording | None = None
        """Best episode that has ended: rather safe than only at the end, then the farthest, then the fastest."""

    def begin(self, worlds: list[int]) -> None:
        """Episodes begin in these worlds."""
        for world in worlds:
            self._rows[world], self._displacements[world] = [], []
        self._force[worlds] = 0.0

    def look(self, info: dict[str, np.ndarray], over: list[int]) -> None:
        """Note where worlds are after a step, and in every case those whose episode is over."""
        self._force = np.maximum(self._force, np.where(info["diverged"], 0.0, info["wall_force"]))
        due = np.rint(info["time"] / self._task.interval).astype(int) % self._every == 0
        due[over] = True
        due &= ~info["diverged"]  # what is left of those is laid straight
        if not due.any():
            return
        qpos = self._task.backend.positions().astype(np.float32)
        table = np.stack([*(info[name] for name in _COLUMNS), self._force], axis=1).astype(np.float32)
        displacement = self._task.displacement
        for world in np.flatnonzero(due):
            self._rows[world].append(np.concatenate([table[world], qpos[world]]))
            if displacement is not None:
                self._displacements[world].append(displacement[world].astype(np.float16))
        self._force[due] = 0.0

    def end(self, world: int, number: int, episode: Any) -> None:
        """An episode has ended with that result (`haustra.envs.learning.evaluate.Episode`)."""
        rank = (float(episode.safe), float(episode.reached), episode.progress, -episode.seconds)
        if rank > self._rank and self._rows[world]:
            rows = np.stack(self._rows[world]).astype(float)
            numbers = dict(zip((*_COLUMNS, "wall_force"), rows.T, strict=False))
            self._rank = rank
            displacement = np.stack(self._displacements[world]).astype(float) if self._displacements[world] else None
            qpos = rows[:, len(_COLUMNS) + 1 :]
            self.best = Recording(number, int(self._task.case[world]), qpos, **numbers, displacement=displacement)
