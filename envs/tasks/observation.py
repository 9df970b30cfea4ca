"""What a learner sees, as arrays over worlds, scaled to about one. Nothing here needs a map, unless it says so."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.sim.coils import COIL_DISTANCES
from haustra.envs.sim.state import Readings
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.sight import RANGE, RAYS, RINGS_DEG, ray_directions
from haustra.errors import InvalidOptionError

STATE = (
    *("bend up [2 rad]", "bend left [2 rad]", "wheel up", "wheel left"),
    *("push force [20 N]", "torque [0.5 N m]", "hand lead [10 mm]", "sin roll", "cos roll"),
    *("insertion [m]", "insertion speed [0.1 m/s]"),
    *("tip force up [10 N]", "tip force left [10 N]", "tip force ahead [10 N]"),
    *("last push", "last roll", "last tip up", "last tip left"),
)
"""Entries of the state: what scope and hand can measure."""
IMAGER_SIZE = 4 * 3 + 3 * len(COIL_DISTANCES)
"""Place of the tip from the anus [0.3 m], its viewing direction and 'up', its speed in its own frame [0.1 m/s]; places
of the shaft from the tip, in the tip's frame [0.3 m]."""
LUMEN_SIZE = 1 + RAYS * len(RINGS_DEG) + 2
"""Distances along the rays over `RANGE`, then the direction, up and left, in which the lumen is deep."""
AHEAD = (0.02, 0.04, 0.06, 0.08, 0.10)
"""Distances along the centreline of the places ahead that the privileged part gives [m]."""
PRIVILEGED_SIZE = 3 + 3 * len(AHEAD)
"""Progress, largest wall force [10 N], friction; places ahead in the tip's frame over `RANGE`."""
IN_BYTES = ("depth", "pixels")
"""Parts whose entries are 0 to 255."""
_LARGEST = 10.0
_REACH = 0.3

Observation = Mapping[str, np.ndarray]


def sizes(config: TaskConfig) -> dict[str, tuple[int, ...]]:
    """Shape of each part that this configuration shows.

    Raises:
        InvalidOptionError: when privileged entries, an imager, memory, depth or pictures are asked for without names.
    """
    size = config.picture_size
    every = {"state": (len(STATE),), "lumen": (LUMEN_SIZE,), "depth": (size, size, 1), "pixels": (size, size, 4)}
    if config.observation != "dict":
        if any((config.privileged, config.memory, config.imager, config.depth, config.pictures)):
            raise InvalidOptionError(
                "Privileged entries, imager, memory, and depth or pictures beside them come under names of their own: "
                "ask for observation 'dict'."
            )
        return {config.observation: every[config.observation]}
    parts = {"state": every["state"], "lumen": every["lumen"]}
    if config.imager:
        parts["imager"] = (IMAGER_SIZE,)
    if config.memory:
        parts["recent"] = (len(config.memory) * measured_size(config),)
    if config.privileged:
        parts["privileged"] = (PRIVILEGED_SIZE,)
    if config.depth:
        parts["depth"] = every["depth"]
    if config.pictures:
        parts["pixels"] = every["pixels"]
    return parts


def measured_size(config: TaskConfig) -> int:
    """How many entries a device itself measures, and remembers if it has a memory."""
    return len(STATE) + IMAGER_SIZE * config.imager


def flat(parts: Observation) -> Float[np.ndarray, "worlds size"]:
    """The parts side by side, in the order of their names, as Gymnasium flattens a Dict."""
    return np.concatenate([parts[name] for name in sorted(parts)], axis=1)


def state(
    seen: Readings,
    wheels: Float[np.ndarray, "worlds 2"],
    action: Float[np.ndarray, "worlds 4"],
    speed: Float[np.ndarray, " worlds"],
) -> Float[np.ndarray, "worlds state"]:
    """What scope and hand can measure (`STATE`)."""
    columns = np.column_stack(
        [
            seen.bend / 2.0,
            wheels,
            seen.push_force / 20.0,
            seen.torque / 0.5,
            seen.hand_lead / 0.01,
            np.sin(seen.roll),
            np.cos(seen.roll),
            seen.insertion,
            speed / 0.1,
            seen.tip_force / 10.0,
            action,
        ]
    )
    return bounded(columns)


def imager(seen: Readings, tip_velocity: Float[np.ndarray, "worlds 3"]) -> Float[np.ndarray, "worlds imager"]:
    """What a magnetic imager of the scope's shape shows, without its noise.

    Args:
        seen: where tip and shaft are.
        tip_velocity: of the tip, in the patient's frame [m/s].
    """
    frame = seen.tip_frame
    shaft = np.einsum("wij,wci->wcj", frame, seen.coils - seen.tip[:, None])
    columns = [
        seen.tip / _REACH,
        frame[:, :, 2],
        frame[:, :, 0],
        np.einsum("wij,wi->wj", frame, tip_velocity) / 0.1,
        shaft.reshape(len(shaft), -1) / _REACH,
    ]
    return bounded(np.column_stack(columns))


class Memory:
    """Running means of what the devices of all worlds have measured themselves, so that any device can have them."""

    def __init__(self, times: tuple[float, ...], worlds: int, size: int, interval: float) -> None:
        """Means of `size` entries that forget by 1/e within each of `times` [s], renewed every `interval` [s]."""
        self._rates = 1.0 - np.exp(-interval / np.array(times, float))
        self._means = np.zeros((len(times), worlds, size), np.float32)

    def begin(self, worlds: Int[np.ndarray, " begun"], measured: Float[np.ndarray, "worlds size"]) -> None:
        """Forget everything in these worlds but what is measured now."""
        self._means[:, worlds] = measured[worlds]

    def add(self, measured: Float[np.ndarray, "worlds size"]) -> None:
        """Take in what is measured now."""
        self._means += self._rates[:, None, None].astype(np.float32) * (measured - self._means)

    def recent(self, measured: Float[np.ndarray, "worlds size"]) -> Float[np.ndarray, "worlds recent"]:
        """How what is measured now differs from each mean."""
        return bounded(np.concatenate(list(measured - self._means), axis=1))


def lumen(distances: Float[np.ndarray, "worlds rays"]) -> Float[np.ndarray, "worlds lumen"]:
    """Distances along rays, and where the lumen is deep: the rays' mean direction, weighted by the cube of distance."""
    near = distances / RANGE
    weight = near**3 + 1e-6
    towards = (weight @ ray_directions()[:, :2]) / weight.sum(axis=1, keepdims=True)
    return bounded(np.column_stack([near, towards]))


def privileged(
    progress: Float[np.ndarray, " worlds"],
    wall_force: Float[np.ndarray, " worlds"],
    friction: Float[np.ndarray, " worlds"],
    ahead: Float[np.ndarray, "worlds places 3"],
) -> Float[np.ndarray, "worlds privileged"]:
    """What no device knows; `ahead` are places of the centreline in the tip's frame [m]."""
    columns = [progress, wall_force / 10.0, friction, ahead.reshape(len(ahead), -1) / RANGE]
    return bounded(np.column_stack(columns))


def bounded(values: np.ndarray) -> np.ndarray:
    """Within the space's bounds, in single precision."""
    return np.clip(values, -_LARGEST, _LARGEST).astype(np.float32)


def bound() -> float:
    """Largest absolute value of an entry."""
    return _LARGEST
