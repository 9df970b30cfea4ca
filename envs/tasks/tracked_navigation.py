"""The tracked robot as a Gymnasium environment: four treads and four bellows drive it along a stretch of colon."""

from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from haustra.envs.runs.tracked_drive import CONTROL_INTERVAL, TrackedRun
from haustra.envs.sim.log import log_to_stderr_only
from haustra.envs.tasks.calls import checked_action, require_no_options
from haustra.envs.tasks.case import TabulatedColon, case_of
from haustra.envs.tasks.sight import RANGE, Sight, ray_directions
from haustra.errors import InvalidOptionError
from haustra.fields import number, read_fields, require_declared, span
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign
from haustra.models.devices.tracked.rig import TIMESTEP, empty_spec
from haustra.models.devices.tracked.standing import places_that_fit, stand_in_colon, wall_near
from haustra.models.scene import add_wall, entry_of
from haustra.models.wall.pieces.build import build_wall
from haustra.models.wall.pieces.wall import Wall

_RPM = 150.0
"""Worm speed at full action [1/min]: the paper's."""
_BELLOWS_RANGE = 0.5
"""Share of its preload by which an action raises or lowers each bellows' force; engineering choice."""
_STATE = 4 + 4 + 1 + 8
_PLACES = 101
"""Places of the start that are tried, evenly spaced; one that fits is drawn."""


@dataclass(frozen=True)
class TrackedRules:
    """An episode of the robot."""

    distance: float = number("m", 0.001, 5.0, default=0.1)
    """Distance that the robot has to go along the colon [m]."""
    start: tuple[float, float] = span("m", 0.0, 10.0, default=(0.25, 0.35))
    """Range of the arc length of the core's centre at the start, drawn evenly from the places where it fits [m]."""
    friction: tuple[float, float] = span("1", 0.0, 2.0, default=(0.3, 0.5))
    """Range of Coulomb's coefficient between treads and wall, drawn evenly [1]."""
    seconds: float = number("s", 0.002, 36_000.0, default=30.0)
    """Longest episode [s]; then it is truncated."""
    force_weight: float = number("1/N", 0.0, 1e4, default=0.01)
    """Cost of a control step per newton of the largest normal force of a track [1/N]."""

    def __post_init__(self) -> None:
        require_declared(self)


class TrackedNavigationEnv(gymnasium.Env):
    """The 1:1 robot in one colon.

    Actions, each from -1 to 1: speed of each tread over that at 150 rpm, then force of each bellows about its preload.
    Observations: a Dict of `state` (strut extensions [10 mm], track forces [N], core force [N], last action) and
    `lumen` (distances along rays from the nose over 12 cm). `info` holds arc length and forces.
    """

    metadata = {"render_modes": [], "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        colon: Colon | None = None,
        wall: Wall | None = None,
        *,
        rules: TrackedRules | dict[str, Any] | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Take a colon and its wall, or grow that of seed 0 with a wall of prisms.

        Raises:
            InvalidOptionError: when pictures are asked for, the way does not fit into the colon, or the robot fits
                nowhere in the range of its starts.
        """
        if render_mode is not None:
            raise InvalidOptionError("The tracked robot's environment draws no pictures: leave render_mode out.")
        log_to_stderr_only()
        self.rules: TrackedRules = read_fields(TrackedRules, rules or {}, "rules")
        self.render_mode = None
        self._colon = colon or grow_colon(seed=0)
        if self.rules.start[1] + self.rules.distance > self._colon.centreline.length:
            raise InvalidOptionError("The robot's way does not fit into the colon: start earlier or go less far.")
        self._design = TrackedDesign().at_scale(1.0)
        half, (low, high) = self._design.core_length / 2, self.rules.start
        self._starts = places_that_fit(self._colon, self._design, np.linspace(max(low, half), max(high, half), _PLACES))
        if not len(self._starts):
            raise InvalidOptionError(
                f"The robot fits nowhere in colon '{self._colon.name}' from start[0] = {low} m to start[1] = {high} m: "
                "widen the range."
            )
        self._wall = wall or build_wall(self._colon, method="prism")
        self._speed = self._design.tread_speed(_RPM)
        self._case: TabulatedColon = case_of(self._colon, device_radius=self._design.core_diameter / 2)
        self._entry, self._axes = entry_of(self._colon)
        self._sight = Sight([self._case])
        self.action_space = spaces.Box(-1.0, 1.0, (2 * TRACKS,), np.float32)
        sizes = {"lumen": len(ray_directions()), "state": _STATE}
        self.observation_space = spaces.Dict(
            {name: spaces.Box(-10.0, 10.0, (size,), np.float32) for name, size in sizes.items()}
        )
        self._run: TrackedRun | None = None
        self._action = np.zeros(2 * TRACKS)
        self._start = self._best = self._friction = 0.0

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Stand the robot in the colon."""
        super().reset(seed=seed)
        rules, design = self.rules, self._design
        require_no_options(options)
        self._start = float(self.np_random.choice(self._starts))
        friction = float(self.np_random.uniform(*rules.friction))
        spec = empty_spec(TIMESTEP)
        reach = design.core_length + design.largest_diameter
        add_wall(spec, wall_near(self._wall, self._start - reach, self._start + reach + rules.distance))
        tracked = stand_in_colon(spec, self._colon, design, arc=self._start, friction=friction)
        self._run = TrackedRun(spec.compile(), tracked, self._colon, self._start, self._speed)
        self._struts = np.array([self._run.model.joint(f"tracked/strut{t}").qposadr[0] for t in range(TRACKS)])
        self._springs = self._run.model.qpos_spring[self._struts].copy()
        self._action[:] = 0.0
        self._best = self._start
        self._run.shares = np.zeros(TRACKS)
        self._run.advance(CONTROL_INTERVAL)
        self._friction = friction
        return self._seen(), self._info(sound=True, reached=False)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One control interval of 20 ms.

        Raises:
            InvalidOptionError: before the first reset, or when the action is not eight numbers.
        """
        run = self._run
        if run is None:
            raise InvalidOptionError("The environment was not reset: call reset first.")
        self._action = np.clip(np.nan_to_num(checked_action(action, (2 * TRACKS,))), -1, 1)
        run.shares = self._action[:TRACKS]
        bellows = self._design.bellows
        shift = _BELLOWS_RANGE * bellows.preload * self._action[TRACKS:] / bellows.stiffness
        run.model.qpos_spring[self._struts] = self._springs + shift
        sound = run.advance(CONTROL_INTERVAL)
        arc = run.tracker.arc
        gained = max(arc - self._best, 0.0) if sound else 0.0
        self._best = max(self._best, arc) if sound else self._best
        forces = run.latest()[0] if sound else np.zeros(TRACKS)
        reached = sound and self._best - self._start >= self.rules.distance
        late = not reached and sound and run.time >= self.rules.seconds
        reward = 100.0 * gained / self.rules.distance - self.rules.force_weight * float(forces.max())
        info = self._info(sound=sound, reached=bool(reached))
        return self._seen(), reward if sound else 0.0, bool(reached or not sound), bool(late), info

    def _info(self, *, sound: bool, reached: bool) -> dict[str, Any]:
        """Ground truth, with the same entries at reset and at every step."""
        run = self._run
        assert run is not None
        return {
            "friction": self._friction,
            "tip_arc": run.tracker.arc,
            "progress": float(np.clip((self._best - self._start) / self.rules.distance, 0.0, 1.0)),
            "wall_force": float(run.latest()[0].max()) if sound else 0.0,
            "reached": reached,
            "diverged": not sound,
        }

    def _seen(self) -> dict[str, np.ndarray]:
        run = self._run
        assert run is not None
        forces, core, struts = run.latest()
        state = np.concatenate([struts / 0.01, forces, [core], self._action])
        place, frame = run.pose()
        nose = place + frame[:, 0] * self._design.core_length / 2
        eye = (nose - self._entry) @ self._axes
        look = self._axes.T @ frame[:, [1, 2, 0]]
        rays = ray_directions() @ look.T
        found = self._sight.distances(np.array([0]), eye[None], rays[None], np.array([run.tracker.arc]))[0]
        shown = {"lumen": found / RANGE, "state": state}
        return {name: np.clip(np.nan_to_num(v), -10, 10).astype(np.float32) for name, v in shown.items()}
