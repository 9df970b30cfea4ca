"""A scope that is inserted and then withdrawn at a constant pull-back, its tip kept towards the lumen ahead.

Inspection happens on the way out. The hand pulls evenly and the tip steers for the middle of the lumen that it leaves;
nobody looks behind folds, and nobody goes back: a lower bound of what a person would see at that speed.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from haustra.envs.control.follower import FollowerSettings, Steering, decide, one_world
from haustra.envs.runs.insertion import Insertion, Progress, drive, run_insertion
from haustra.envs.runs.treatment import PATIENCE, Treatment
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.state import Controls, Readings
from haustra.models.anatomy.surface_landmarks import inspection_number
from haustra.models.scene import Scene

INTERVAL = 0.1
"""Time between two decisions and two records of a withdrawal [s]; engineering choice: a slow pull needs no more."""
_SLACK_TIME = 60.0
"""How much longer than its length over its speed a withdrawal may take [s]: a pleated colon lets go late."""
_LARGEST_BEND_DEG = 60.0
"""Largest angle that the tip is bent to [degrees]; engineering choice: a tip bent further hooks the wall and holds."""
_LET_GO = 3.0
"""Wall force on the bending section at which the wheels are let go [N], and from half of which they are eased;
engineering choice: a hook that is let go slides out instead of gathering the colon."""
_APPROACH = 0.005
"""Speed at which a scope is pushed towards a polyp that its instrument does not reach [m/s]; engineering choice."""
_NEVER = 600.0
"""Patience, in seconds, of a follower that never backs off."""


class PullBack:
    """Pulls a scope out at a constant rate and steers by the rules of the lumen follower, which never backs off.

    With an instrument it stops at each polyp that the tip comes by and steers for it, as long as `Treatment` says.
    """

    def __init__(self, scene: Scene, *, rate: float | None = None, treatment: Treatment | None = None) -> None:
        """Take hold of a scope; `rate` is the speed [m/s], that of assets/numbers/inspection.toml when None."""
        self.rate = inspection_number("withdrawal_rate") if rate is None else rate
        unbothered = {"patience": _NEVER, "tip_force_limit": 1e4, "wall_force_limit": 1e4, "push_force_limit": 1e4}
        limits = {"advance_rate": self.rate, "steer_limit_deg": _LARGEST_BEND_DEG}
        self.settings = replace(FollowerSettings(), **limits, **unbothered)
        self._line, self._tip_links, self._treatment = scene.colon.centreline, scene.cable.tip_links, treatment
        self._steering = Steering.of(scene.design, self.settings)
        self._aiming = Steering.of(scene.design, replace(self.settings, steer_limit_deg=360.0))
        self._memory = self.settings.law().begin(np, 1, np.float64)

    def act(self, seen: Readings, arc: float, interval: float) -> Controls:
        """Inputs for the next `interval` [s]; the hand never aims far behind where the shaft is."""
        goal, nearer = None, False
        if self._treatment is not None:
            goal, nearer = self._treatment.goal(seen, arc), self._treatment.too_far
        target = self._ahead(seen, arc) if goal is None else goal
        own = {"time": np.array([seen.time]), "arc": np.array([arc]), "target": target[None], "interval": interval}
        steering = self._steering if goal is None else self._aiming
        steered, self._memory = decide(
            np, self.settings, steering, one_world(seen), self._memory, tip_links=self._tip_links, **own
        )
        slowest = (-self.settings.hand_lead_limit - seen.hand_lead) / interval
        rate = min(max(-self.rate, slowest), 0.0) if goal is None else _APPROACH * nearer
        held = float(seen.link_forces[-self._tip_links :].max()) / _LET_GO
        ease = min(max(2 * (1 - held), 0.0), 1.0) if goal is None else 1.0
        return Controls(rate, 0.0, steered.pulls[0] * ease)

    def _ahead(self, seen: Readings, arc: float) -> Float[np.ndarray, "3"]:
        """Place of the centreline that it steers for, where it is now [m]."""
        points = self._line.points if seen.way is None else seen.way
        place = arc + self.settings.look_ahead
        return np.array([np.interp(place, self._line.arc, points[:, axis]) for axis in range(3)])

    @property
    def asked(self) -> Float[np.ndarray, "2"]:
        """Bend that it steers for, towards wires 'up' and 'left' [rad]."""
        return np.array([self._memory.bend_up[0], self._memory.bend_left[0]])

    @property
    def attempts(self) -> int:
        """Times that it backed off: never."""
        return 0

    @property
    def gives_up(self) -> bool:
        """Whether it ends the run: never."""
        return False


def insert_and_withdraw(
    scene: Scene,
    *,
    seconds: float,
    settings: FollowerSettings | None = None,
    rate: float | None = None,
    treatment: Treatment | None = None,
    progress: Progress | None = None,
) -> tuple[Insertion, Insertion]:
    """Drive a scope in, as `run_insertion`, and pull it out from wherever it came to, on the backend 'linear'.

    The time of the withdrawal goes on from that of the insertion.

    Args:
        scene: a colon that a table stands for, and a scope.
        seconds: longest insertion, in simulated time [s].
        settings: of the follower that inserts.
        rate: speed of the pull-back [m/s]; that of assets/numbers/inspection.toml when None.
        treatment: what is done to polyps on the way out; nothing when None.
        progress: told now and then how far it is.

    Raises:
        UnsupportedSceneError: when the backend cannot honour the scene.
    """
    backend = LinearSingle(scene)
    own = {"seconds": seconds, "settings": settings, "progress": progress}
    inserted = run_insertion(scene, backend=lambda _: backend, **own)
    puller, began = PullBack(scene, rate=rate, treatment=treatment), float(backend.read().time)
    until = began + (backend.insertion - scene.options.start_depth) / puller.rate + _SLACK_TIME
    until += PATIENCE * len(scene.colon.lesions) if treatment else 0.0
    recorded = inserted.trajectory.tip_arc
    arc = float(recorded[-1]) if len(recorded) else scene.options.start_depth
    own = {"until": until, "arc": arc, "every": INTERVAL, "left": True, "progress": progress}
    return inserted, drive(backend, puller, puller.settings, **own)
