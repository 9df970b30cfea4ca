"""Who withdraws with open eyes: keeps the lumen in view, looks to where mucosa was not seen, and does not tug."""

import numpy as np
from jaxtyping import Bool, Float

from haustra.envs.tasks.drivers import insufflated
from haustra.envs.tasks.observation import STATE, Observation
from haustra.envs.tasks.scope_task import ScopeTask
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.surface_landmarks import inspection_number

_LEISURE = 1.08
"""The shaft comes out by its length in `Limits.pace` times this [1]: tips come out a little sooner; engineering
choice."""
_SEEKING = 1.0
"""Turn of the wheels for each unit of the lumen's direction [1]; engineering choice: a tip that lies along the lumen
slides round flexures that hook one which was let go."""
_EAGER = 0.8
"""Turn of the wheels where all mucosa on one side of the tip is unseen [1]; engineering choice."""
_WIDE, _CIRCLE = 0.25, 6.0
"""Turn of the wheels [1] and time [s] of a circle of the routine; engineering choices."""
_MOST_TENSION, _LOOKS_UNTIL = 12.0, 6.0
"""Tension of the hand at which pulling has ceased, and at which nobody looks aside any more [N]; engineering choice:
clinics' hands pulled with 17.7 N at most (Appleyard 2000)."""
_WIDEST, _SWIFT = 0.5, 1.0
"""Farthest turn of the wheels [1], and time within which they follow [s]; engineering choices: a tip that is bent back,
or at once, levers at the wall with tens of newtons."""
_LET_GO = 4.0
"""Force of the wall on the tip at which wheels are let go, and from half of which they are eased [N];
engineering choice."""
_PATIENCE, _FREEING = 20.0, 8.0
"""Time without a way out of `_STEP` after which the scope is freed, and how long that takes [s]; engineering choice."""
_STEP = 0.005
"""Way out that counts as one [m]; engineering choice."""
_INWARD = 0.008
"""Rate at which a stuck scope is pushed back in [m/s]; engineering choice."""
_ROLL = 0.6
"""Rate at which it is rolled meanwhile, one way and then the other [rad/s]; engineering choice: a hook that has no
tension is turned out of the fold that holds it."""
_TIP = STATE.index("tip force up [10 N]")
_PUSH, _INSERTED = STATE.index("push force [20 N]"), STATE.index("insertion [m]")


class InspectDriver:
    """Withdraws at the pace of the task where nothing holds it, and sees what there is to see."""

    def __init__(self, task: ScopeTask, *, routine: bool = False) -> None:
        """Drive the worlds of a task of withdrawal.

        Args:
            task: theirs.
            routine: turn the tip in circles about the lumen, as endoscopists are taught, instead of looking to where
                mucosa is unseen, of which no device keeps account.

        Raises:
            InvalidOptionError: when the task does not show state, lumen, and where mucosa is unseen.
        """
        if not {"state", "lumen", "unseen"} <= task.parts.keys():
            raise InvalidOptionError("The driver 'inspect' withdraws: give --task withdrawal, and observation 'dict'.")
        self._task, self._routine = task, routine
        self._age = np.zeros(task.worlds)
        self._began, self._furthest = np.full(task.worlds, np.nan), np.full(task.worlds, np.inf)
        self._still, self._freed = np.zeros(task.worlds), np.zeros(task.worlds)
        self._slack, self._wheels = np.zeros(task.worlds, bool), np.zeros((task.worlds, 2))

    def begin(self, worlds: Bool[np.ndarray, " worlds"]) -> None:
        """New colons: nothing is stuck."""
        self._began[worlds], self._furthest[worlds], self._age[worlds] = np.nan, np.inf, 0.0
        self._still[worlds], self._freed[worlds], self._slack[worlds] = 0.0, 0.0, False
        self._wheels[worlds] = 0.0

    def act(self, seen: Observation) -> Float[np.ndarray, "worlds actions"]:
        """Pull and look; where the scope is stuck, push back and roll, and let the wheels go or seek the lumen."""
        drive, inserted = self._task.config.drive, seen["state"][:, _INSERTED].astype(float)
        tension = np.maximum(-20.0 * seen["state"][:, _PUSH], 0.0)
        self._began = np.where(np.isnan(self._began), inserted, self._began)
        freeing = self._is_freed(inserted)
        rate = np.minimum(self._began / (_LEISURE * self._task.config.limits.pace), _fastest())
        pull = rate * np.clip(3.0 * (1.0 - tension / _MOST_TENSION), -0.5, 1.0)
        ease = np.clip(1.0 - tension / _LOOKS_UNTIL, 0.0, 1.0)[:, None]
        wheels = _SEEKING * seen["lumen"][:, -2:] + ease * self._aside(seen)
        pressed = 10.0 * np.linalg.norm(seen["state"][:, _TIP : _TIP + 3], axis=1)
        wheels = wheels * np.clip(2.0 * (1.0 - pressed / _LET_GO), 0.0, 1.0)[:, None]
        wheels = np.where(self._slack[:, None], 0.0, wheels)
        wheels = wheels * np.minimum(1.0, _WIDEST / np.maximum(np.linalg.norm(wheels, axis=1), 1e-9))[:, None]
        self._wheels = self._wheels + min(1.0, self._task.interval / _SWIFT) * (wheels - self._wheels)
        push = np.where(freeing, _INWARD, -pull) / drive.push_rate
        roll = np.where(freeing, np.where(self._slack, _ROLL, -_ROLL), 0.0) / drive.roll_rate
        return insufflated(self._task, np.clip(np.column_stack([push, roll, self._wheels]), -1.0, 1.0))

    def _aside(self, seen: Observation) -> Float[np.ndarray, "worlds 2"]:
        """Where it looks beside the lumen."""
        self._age = self._age + self._task.interval
        turn = 2.0 * np.pi * self._age / _CIRCLE
        return (
            _WIDE * np.stack([np.cos(turn), np.sin(turn)], axis=1) if self._routine else _EAGER * seen["unseen"][:, 2:4]
        )

    def _is_freed(self, inserted: Float[np.ndarray, " worlds"]) -> Bool[np.ndarray, " worlds"]:
        """Which scopes are being freed now: in turns with wheels let go, and seeking the lumen."""
        came = inserted < self._furthest - _STEP
        self._furthest = np.where(came, inserted, self._furthest)
        self._still = np.where(came, 0.0, self._still + self._task.interval)
        begins = (self._still > _PATIENCE) & (self._freed <= 0)
        self._freed = np.where(begins, _FREEING, self._freed - self._task.interval)
        self._slack = self._slack ^ begins
        self._still = np.where(begins, -2.0 * _FREEING, self._still)
        return self._freed > 0


def _fastest() -> float:
    return inspection_number("withdrawal_rate")
