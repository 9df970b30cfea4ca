"""Episodes of many worlds of any device: its declared controls in; observations, rewards and endings out."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.runs.device_run import ended
from haustra.envs.runs.outcome import Outcome
from haustra.envs.sim.device_worlds import load_device_worlds
from haustra.envs.tasks.calls import whole_steps
from haustra.envs.tasks.observation import Observation
from haustra.envs.tasks.step import Step
from haustra.errors import InvalidOptionError
from haustra.fields import number, read_fields, require_declared, span
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.device_scene import build_device_scene, device_options, device_tables, pose_in
from haustra.models.devices.base import Device, DeviceReadings, load_device
from haustra.models.injury.perforation import link_load, perforation_probability, worst_load

_COMMON = 3 + 1 + 1 + 1
"""Direction ahead in the tip's frame, progress, wall force, room."""
LARGEST = 20.0
"""Bound of all observations."""
_SHOWN_IN = {"m": 0.1, "m/s": 1e-2, "Pa": 1e3, "N m": 1e-3}
"""Units that own readings are shown in, over those of a metre, newton or second, where they are of another size;
engineering choice: numbers of about one."""


@dataclass(frozen=True)
class DeviceRules:
    """Episodes of any device."""

    device: str = "adult"
    """Device that is driven: a shipped design's name, or a TOML file."""
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

    def to_json(self) -> dict[str, Any]:
        """As plain JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> "DeviceRules":
        """Read what `to_json` wrote.

        Raises:
            InvalidOptionError: naming a value that is not known or out of its range.
        """
        return read_fields(cls, values, "rules")


def seen_by_device(
    device: Device, seen: DeviceReadings, own: dict[str, Any], lengths: Float[np.ndarray, " worlds"]
) -> Float[np.ndarray, "worlds entries"]:
    """What a driver of a device is shown: readings that every device has, then its own.

    The direction of the lumen ahead in the tip's frame, the share of the colon passed, wall force [N], depth in the
    wall [cm], then the device's own readings: lengths in dm, speeds in cm/s, pressures in kPa, torques in mN m.

    Args:
        device: the device.
        seen: what every device can be told by.
        own: its own readings, by name.
        lengths: of the colons [m].
    """
    ahead = np.einsum("wij,wi->wj", seen.tip_frame, seen.ahead)
    common = [seen.tip_arc / lengths, seen.wall_force, 100.0 * seen.deepest]
    told = [
        own[one.name] / _SHOWN_IN.get(one.unit, 1.0) for one in device.readings
    ]  # on Warp not in the order in which the device names them
    shown = np.column_stack([ahead, *common, *told])
    return np.clip(np.nan_to_num(shown), -LARGEST, LARGEST).astype(np.float32)


def entries_of(device: Device) -> int:
    """How many numbers `seen_by_device` shows."""
    return _COMMON + len(device.readings)


def commands_of(device: Device, action: Float[np.ndarray, "worlds channels"]) -> Float[np.ndarray, "worlds channels"]:
    """Commands for actions from -1 to 1, each over its channel's range; what is no number is the range's middle."""
    low, high = limits_of(device)
    return low + 0.5 * (np.clip(np.nan_to_num(action), -1, 1) + 1) * (high - low)


def limits_of(device: Device) -> tuple[Float[np.ndarray, " channels"], Float[np.ndarray, " channels"]]:
    """Least and largest command of each channel, in its unit."""
    return np.array([one.low for one in device.controls]), np.array([one.high for one in device.controls])


class DeviceTask:
    """Worlds of one device in grown colons, natively or on MuJoCo Warp, against the lumen's table.

    Reward: progress through the colon in percent, less force. Nothing resets by itself.
    """

    def __init__(
        self,
        rules: DeviceRules,
        *,
        device: Device | None = None,
        colons: Sequence[Colon] | None = None,
        worlds: int = 1,
        threads: int = 1,
        backend: str = "native",
    ) -> None:
        """Load the device, or take one, and colons, or grow those of the rules' seeds.

        Raises:
            InvalidOptionError: when the backend is neither 'native' nor 'warp'.
            InvalidDesignError: when the device is not known.
            MissingDependencyError: when what the backend computes with is not installed.
            UnsupportedSceneError: when it cannot meet the lumen's table, or the backend cannot honour it.
        """
        self.config, self.worlds = rules, worlds
        self.device = device or load_device(rules.device)
        options = device_options(self.device, mesentery=rules.mesentery)
        scene = build_device_scene(self.device, options)
        self._steps = whole_steps(rules.control_interval, scene.options.timestep)
        self.interval = self._steps * scene.options.timestep
        self.colons = list(colons or [grow_colon(seed=seed) for seed in range(*rules.seeds)])
        self._lengths = np.array([colon.centreline.length for colon in self.colons])
        poses = [pose_in(colon, self.device, options) for colon in self.colons]
        tables, starts = device_tables(scene, self.colons, poses), [pose.arc for pose in poses]
        self.backend = load_device_worlds(backend, scene, tables, worlds=worlds, threads=threads, starts=starts)
        self._diameter = 2 * scene.handles.samples[-1].radius
        self._random = [np.random.default_rng() for _ in range(worlds)]
        self.case, self._best = np.zeros(worlds, int), np.zeros(worlds)
        self._load = np.zeros((2, worlds))
        self._drawn = {name: np.zeros(worlds) for name in ("friction", "wall_stiffness")}
        self._outcome: list[Outcome | None] = [None] * worlds
        self._seen: tuple[DeviceReadings, dict[str, np.ndarray]] | None = None

    @property
    def seen(self) -> tuple[DeviceReadings, dict[str, np.ndarray]]:
        """What can be read off all worlds now, and the device's own readings, looked up once a step."""
        self._seen = self._seen or (self.backend.read(), self.backend.readings())
        return self._seen

    def reset(
        self,
        worlds: Int[np.ndarray, " reset"] | None = None,
        seeds: list[int] | None = None,
        case: Int[np.ndarray, " reset"] | None = None,
    ) -> Observation:
        """Put the devices of some worlds, or all, to the anus of a colon each.

        Args:
            worlds: which, in rising order.
            seeds: of their random draws from now on; the streams that they have go on when None.
            case: which colon each gets; drawn when None.

        Returns:
            What all worlds see now.
        """
        worlds = np.arange(self.worlds) if worlds is None else worlds
        for place, world in enumerate(worlds.tolist()):
            if seeds is not None:
                self._random[world] = np.random.default_rng(seeds[place])
            random = self._random[world]
            drawn = int(random.integers(len(self.colons)))
            self.case[world] = drawn if case is None else case[place]
            for name, values in self._drawn.items():
                values[world] = random.uniform(*getattr(self.config, name))
            self._outcome[world] = None
        self.backend.reset(worlds, self.case[worlds], **{name: own[worlds] for name, own in self._drawn.items()})
        self._seen = None
        self._best[worlds], self._load[:, worlds] = self.seen[0].tip_arc[worlds], 0.0
        return self.observe()

    def step(self, action: Float[np.ndarray, "worlds channels"]) -> Step:
        """One control interval: actions from -1 to 1, one a channel."""
        rules, before = self.config, self._best.copy()
        sound = self.backend.step(commands_of(self.device, action), self._steps)
        self._seen = None
        seen, lengths = self.seen[0], self._lengths[self.case]
        for world in range(self.worlds):
            row = {"tip_arc": seen.tip_arc[world], "deepest": seen.deepest[world]}
            self._outcome[world] = ended(row, lengths[world]) if sound[world] else Outcome.DIVERGED
        escaped = np.array([outcome is Outcome.ESCAPED for outcome in self._outcome])
        load = link_load(np, seen.wall_force, 0.0, True, self._diameter)
        worst = worst_load(np, (self._load[0], self._load[1]), load, np.maximum(seen.tip_arc, 0.0), escaped)
        self._load = np.where(sound, np.array(worst), self._load)
        self._best = np.where(sound, np.maximum(before, seen.tip_arc), before)
        cost = rules.force_weight * (seen.wall_force / rules.safe_force) ** 2
        reward = np.where(sound, 100.0 * (self._best - before) / lengths - cost, 0.0)
        over = np.array([outcome is not None for outcome in self._outcome])
        late = ~over & (seen.time >= rules.seconds - self.interval / 2)
        return Step(self.observe(), reward, over, late, self.info())

    def observe(self) -> Observation:
        """What all worlds see now."""
        return {"state": seen_by_device(self.device, *self.seen, self._lengths[self.case])}

    def info(self) -> dict[str, np.ndarray]:
        """Ground truth, with the same entries at any time; `outcome` is one of `Outcome` or empty."""
        seen, own = self.seen
        outcome = np.array([one.value if one else "" for one in self._outcome])
        return {
            **{name: values.copy() for name, values in self._drawn.items()},
            "case": self.case.copy(),
            "time": seen.time,
            "tip_arc": seen.tip_arc,
            "progress": np.minimum(self._best / self._lengths[self.case], 1.0),
            "wall_force": seen.wall_force,
            "reached": outcome == Outcome.COMPLETED.value,
            "perforated": self._load[0] >= 1.0,  # that of a person of median strength
            "p_perforation": perforation_probability(self._load[0]),
            "perforation_arc": self._load[1].copy(),
            "outcome": outcome,
            **own,
        }

    def close(self) -> None:
        """Nothing is held open."""
