"""Any device as a Gymnasium environment: its declared controls in, what it is told by out."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from haustra.envs.runs.device_run import ended
from haustra.envs.runs.outcome import Outcome
from haustra.envs.sim.device_worlds import load_device_worlds
from haustra.envs.tasks.calls import checked_action, require_no_options, whole_steps
from haustra.errors import InvalidOptionError
from haustra.fields import number, read_fields, require_declared, span
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.device_scene import build_device_scene, device_options, device_tables, pose_in
from haustra.models.devices.base import Device, load_device
from haustra.models.injury.perforation import link_load, perforation_probability, worst_load

_COMMON = 3 + 1 + 1 + 1
"""Direction ahead in the tip's frame, progress, wall force, room."""
_LARGEST = 10.0
"""Bound of all observations."""


@dataclass(frozen=True)
class DeviceRules:
    """An episode of any device."""

    seeds: tuple[int, int] = span("1", 0, 10**9, default=(0, 1), whole=True)
    """Seeds of the grown colons: from the first up to, not including, the last; one is drawn for each episode."""
    friction: tuple[float, float] = span("1", 0.0, 2.0, default=(0.03, 0.1))
    """Range of Coulomb's coefficient between device and wall, drawn evenly [1]."""
    wall_stiffness: tuple[float, float] = span("N/m", 50.0, 1e5, default=(700.0, 2400.0))
    """Range of the stiffness of a contact with the wall, drawn evenly: as measured [N/m]."""
    mesentery: bool = False
    """Let colons move on their mesentery."""
    seconds: float = number("s", 0.002, 36_000.0, default=90.0)
    """Longest episode [s]; then it is truncated."""
    control_interval: float = number("s", 0.001, 1.0, default=0.04)
    """Time between two actions [s]."""
    force_weight: float = number("1", 0.0, 1e4, default=0.02)
    """Cost of a control step, times the square of the wall force over `safe_force` [1]."""
    safe_force: float = number("N", 0.01, 1e4, default=5.0)
    """Wall force at which a control step costs `force_weight` [N]; engineering choice."""

    def __post_init__(self) -> None:
        require_declared(self)
        if self.seeds[0] == self.seeds[1]:
            raise InvalidOptionError(f"seeds {self.seeds} hold no colon: give a first and a larger last one.")


class DeviceEnv(gymnasium.Env):
    """One device in grown colons, natively or on MuJoCo Warp, against the lumen's table.

    Actions: one number from -1 to 1 a declared channel, over its range. Observations: the direction of the lumen ahead
    in the tip's frame, the share of the colon passed, wall force [N], depth in the wall [cm], then the device's own
    readings over those of a metre, newton or second. Reward: progress through the colon in percent, less force.
    """

    metadata = {"render_modes": [], "render_fps": 25}  # noqa: RUF012

    def __init__(
        self,
        device: str | Device = "adult",
        *,
        colons: Sequence[Colon] | None = None,
        rules: DeviceRules | dict[str, Any] | None = None,
        render_mode: str | None = None,
        backend: str = "native",
    ) -> None:
        """Take a device, or load one by name or file, and colons, or grow those of the rules' seeds.

        Raises:
            InvalidOptionError: when pictures are asked for, or the backend is neither 'native' nor 'warp'.
            InvalidDesignError: when the device is not known.
            MissingDependencyError: when what the backend computes with is not installed.
            UnsupportedSceneError: when it cannot meet the lumen's table, or the backend cannot honour it.
        """
        if render_mode is not None:
            raise InvalidOptionError("The environment of any device draws no pictures: leave render_mode out.")
        self.render_mode = None
        self.rules: DeviceRules = read_fields(DeviceRules, rules or {}, "rules")
        self.device = device if isinstance(device, Device) else load_device(device)
        options = device_options(self.device, mesentery=self.rules.mesentery)
        scene = build_device_scene(self.device, options)
        self._steps = whole_steps(self.rules.control_interval, scene.options.timestep)
        colons = list(colons or [grow_colon(seed=seed) for seed in range(*self.rules.seeds)])
        self._lengths = [colon.centreline.length for colon in colons]
        poses = [pose_in(colon, self.device, options) for colon in colons]
        tables, starts = device_tables(scene, colons, poses), [pose.arc for pose in poses]
        self._backend = load_device_worlds(backend, scene, tables, starts=starts)
        channels = self.device.controls
        self._low = np.array([channel.low for channel in channels])
        self._high = np.array([channel.high for channel in channels])
        self.action_space = spaces.Box(-1.0, 1.0, (len(channels),), np.float32)
        size = _COMMON + len(self.device.readings)
        self.observation_space = spaces.Box(-_LARGEST, _LARGEST, (size,), np.float32)
        self._colon, self._best, self._begun, self._load = 0, 0.0, False, (0.0, 0.0)
        self._diameter = 2 * scene.handles.samples[-1].radius
        self._drawn: dict[str, np.ndarray] = {}

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Put the device to the anus of a colon."""
        super().reset(seed=seed)
        require_no_options(options)
        rules = self.rules
        self._colon = int(self.np_random.integers(len(self._lengths)))
        self._drawn = {
            name: np.array([self.np_random.uniform(*getattr(rules, name))]) for name in ("friction", "wall_stiffness")
        }
        self._backend.reset(np.zeros(1, int), np.array([self._colon]), **self._drawn)
        self._best, self._begun, self._load = float(self._backend.read().tip_arc[0]), True, (0.0, 0.0)
        return self._shown(), self._info(None)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One control interval.

        Raises:
            InvalidOptionError: before the first reset, or when the action is not one number a channel.
        """
        if not self._begun:
            raise InvalidOptionError("The environment was not reset: call reset first.")
        share = np.clip(np.nan_to_num(checked_action(action, (len(self._low),))), -1, 1)
        commands = self._low + 0.5 * (share + 1) * (self._high - self._low)
        sound = bool(self._backend.step(commands[None], self._steps)[0])
        seen, length = self._backend.read(), self._lengths[self._colon]
        arc, force = float(seen.tip_arc[0]), float(seen.wall_force[0])
        row = {"tip_arc": arc, "deepest": float(seen.deepest[0])}
        outcome = ended(row, length) if sound else Outcome.DIVERGED
        if sound:
            load, escaped = link_load(np, force, 0.0, True, self._diameter), outcome is Outcome.ESCAPED
            self._load = worst_load(np, self._load, load, max(arc, 0.0), escaped)
        gained = max(arc - self._best, 0.0) if sound else 0.0
        self._best += gained
        reward = 100.0 * gained / length - self.rules.force_weight * (force / self.rules.safe_force) ** 2
        late = outcome is None and float(seen.time[0]) >= self.rules.seconds
        return self._shown(), reward if sound else 0.0, outcome is not None, late, self._info(outcome)

    def _info(self, outcome: Outcome | None) -> dict[str, Any]:
        """Ground truth, with the same entries at reset and at every step; `outcome` is one of `OUTCOMES` or empty."""
        seen = self._backend.read()
        told = {name: float(value[0]) for name, value in self._backend.readings().items()}
        return {
            **{name: float(value[0]) for name, value in self._drawn.items()},
            "tip_arc": float(seen.tip_arc[0]),
            "progress": min(self._best / self._lengths[self._colon], 1.0),
            "wall_force": float(seen.wall_force[0]),
            "p_perforation": float(perforation_probability(self._load[0])),
            "perforation_arc": float(self._load[1]),
            "outcome": outcome.value if outcome else "",
            **told,
        }

    def _shown(self) -> np.ndarray:
        seen = self._backend.read()
        ahead = seen.tip_frame[0].T @ seen.ahead[0]
        common = [seen.tip_arc[0] / self._lengths[self._colon], seen.wall_force[0], 100.0 * seen.deepest[0]]
        told = self._backend.readings()  # on Warp not in the order in which the device names them
        own = [told[one.name][0] for one in self.device.readings]
        shown = np.concatenate([ahead, common, own])
        return np.clip(np.nan_to_num(shown), -_LARGEST, _LARGEST).astype(np.float32)
