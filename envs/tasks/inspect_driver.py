"""Who withdraws with open eyes: pulls as the hand bears it, looks to where mucosa was not seen, frees a stuck tip."""

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.tasks.drivers import insufflated
from haustra.envs.tasks.observation import STATE, Observation
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.surface_landmarks import inspection_number

_EAGER = 1.3
"""Turn of the wheels where all mucosa on one side of the tip is unseen [1]; engineering choice, of 0.8 to 1.5 tried."""
_MOST_TENSION, _LET_GO = 10.0, 4.0
"""Tension of the hand at which pulling has ceased, and at which wheels are let go [N]; engineering choice: a bent tip
hooks."""
_PATIENCE, _FREEING = 8.0, 5.0
"""Time without a way out of `_STEP` after which the scope is freed, and how long that takes [s]; engineering choice."""
_STEP = 0.005
"""Way out that counts as one [m]; engineering choice."""
_INWARD = 0.008
"""Rate at which a stuck scope is pushed back in while it is rolled [m/s]; engineering choice."""
_SEEKING = 2.0
"""Turn of the wheels for each unit of the lumen's direction while the scope is freed [1]; engineering choice."""
_PUSH, _INSERTED = STATE.index("push force [20 N]"), STATE.index("insertion [m]")


class InspectDriver:
    """Withdraws at the rate of assets/numbers/inspection.toml where nothing holds it, and sees what there is to see."""

    def __init__(self, task: ScopeTask) -> None:
        """Drive the worlds of a task of withdrawal.

        Raises:
            InvalidOptionError: when the task does not show state, lumen, and where mucosa is unseen.
        """
        if not {"state", "lumen", "unseen"} <= task.parts.keys():
            raise InvalidOptionError("The driver 'inspect' withdraws: give --task withdrawal, and observation 'dict'.")
        self._task = task
        self._furthest = np.full(task.worlds, np.inf)
        self._still, self._freed, self._sense = np.zeros(task.worlds), np.zeros(task.worlds), np.ones(task.worlds)

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """New colons: nothing is stuck."""
        self._furthest[worlds], self._still[worlds], self._freed[worlds], self._sense[worlds] = np.inf, 0.0, 0.0, 1.0

    def act(self, seen: Observation) -> Float[np.ndarray, "worlds actions"]:
        """Pull and look; where the scope is stuck, push, roll and seek the lumen for a while."""
        drive, unseen = self._task.config.drive, seen["unseen"]
        tension = np.maximum(-20.0 * seen["state"][:, _PUSH], 0.0)
        freeing = self._is_freed(seen["state"][:, _INSERTED])
        rate = inspection_number("withdrawal_rate") * np.clip(1.5 - 1.5 * tension / _MOST_TENSION, -0.5, 1.0)
        look = _EAGER * np.clip(1.0 - tension / _LET_GO, 0.0, 1.0)[:, None] * unseen[:, 2:4]
        wheels = np.where(freeing[:, None], _SEEKING * seen["lumen"][:, -2:], look)
        push = np.where(freeing, _INWARD, -rate) / drive.push_rate
        roll = np.where(freeing, self._sense, 0.0)
        return insufflated(self._task, np.clip(np.column_stack([push, roll, wheels]), -1.0, 1.0))

    def _is_freed(self, inserted: Float[np.ndarray, " worlds"]) -> Bool[np.ndarray, " worlds"]:
        """Which scopes are being freed now: in turns by rolling one way and the other."""
        came = inserted < self._furthest - _STEP
        self._furthest = np.where(came, inserted, self._furthest)
        self._still = np.where(came, 0.0, self._still + self._task.interval)
        begins = (self._still > _PATIENCE) & (self._freed <= 0)
        self._freed = np.where(begins, _FREEING, self._freed - self._task.interval)
        self._sense = np.where(begins, -self._sense, self._sense)
        self._still = np.where(begins, -_FREEING, self._still)
        return self._freed > 0
