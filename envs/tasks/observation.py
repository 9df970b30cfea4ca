"""What a learner sees, as arrays over worlds, scaled to about one. Nothing here needs a map, unless it says so."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from haustra.envs.sim.coils import COIL_DISTANCES
from haustra.envs.sim.state import Readings
from haustra.envs.tasks.config import TaskConfig
from haustra.envs.tasks.sight import RANGE, RAYS, RINGS_DEG, ray_directions
from haustra.errors import InvalidOptionError
from haustra.models.wall import vectors
from haustra.models.wall.vectors import Vector, add, dot, minus, times

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
GAS = ("pressure at the tip [3 kPa]", "gas in the colon [L]", "last gas")
"""Entries of the gas that a learner with a gas action is shown."""
AHEAD = (0.02, 0.04, 0.06, 0.08, 0.10)
"""Distances along the centreline of the places ahead that the privileged part gives [m]."""
UNSEEN_SIZE = 5
"""Share of the surface seen; of the wall near the tip the share never seen, and towards where that is: up, left, ahead
(`haustra.envs.tasks.coverage.unseen`)."""
PRIVILEGED_SIZE = 3 + 3 * len(AHEAD)
"""Progress, largest wall force [10 N], friction; places ahead in the tip's frame over `RANGE`."""
IN_BYTES = ("depth", "pixels")
"""Parts whose entries are 0 to 255."""
BESIDE = (-0.015, 0.015)
"""Places of the centreline, from the tip on, between which its direction is taken [m]: at its end one is before it."""
_LARGEST = 10.0
_REACH = 0.3

Observation = Mapping[str, np.ndarray]


def sizes(config: TaskConfig) -> dict[str, tuple[int, ...]]:
    """Shape of each part that this configuration shows.

    Raises:
        InvalidOptionError: when privileged entries, an imager, gas, memory, depth or pictures are asked for without
            names.
    """
    size = config.picture_size
    every = {"state": (len(STATE),), "lumen": (LUMEN_SIZE,), "depth": (size, size, 1), "pixels": (size, size, 4)}
    if config.observation != "dict":
        named = config.privileged, config.memory, config.imager, config.depth, config.pictures, config.gas_action
        if any(named):
            raise InvalidOptionError(
                "Privileged entries, imager, gas, memory, and depth or pictures beside them come under names of their "
                "own: ask for observation 'dict'."
            )
        return {config.observation: every[config.observation]}
    parts = {"state": every["state"], "lumen": every["lumen"]}
    if config.imager:
        parts["imager"] = (IMAGER_SIZE,)
    if config.gas_action:
        parts["gas"] = (len(GAS),)
    if config.memory:
        parts["recent"] = (len(config.memory) * measured_size(config),)
    if config.task == "withdrawal":
        parts["unseen"] = (UNSEEN_SIZE,)
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


class Felt(NamedTuple):
    """What scope and hand measure; one number a world, or a tuple of them."""

    bend: tuple[Any, Any]
    """Angle of the bending section towards wires 'up' and 'left' [rad]."""
    push_force: Any
    """Force of the hand along the shaft [N]."""
    torque: Any
    """Torque of the hand about the shaft [N m]."""
    hand_lead: Any
    """How far the hand aims ahead of the shaft [m]."""
    roll: Any
    """Angle of the handle [rad]."""
    insertion: Any
    """Length of scope past the anus [m]."""
    tip_force: Vector
    """Force of the wall on the bending section and tip, in the tip's frame [N]."""

    @classmethod
    def of(cls, seen: Readings) -> "Felt":
        """From readings of many worlds."""
        bend = seen.bend[:, 0], seen.bend[:, 1]
        hand = seen.push_force, seen.torque, seen.hand_lead
        return cls(bend, *hand, seen.roll, seen.insertion, vectors.of(seen.tip_force))


class Placed(NamedTuple):
    """Where a scope is, from the entry; vectors of one number a world each."""

    tip: Vector
    """Place of the tip [m]."""
    frame: tuple[Vector, Vector, Vector]
    """Directions of wires 'up' and 'left', and the viewing direction."""
    coils: Sequence[Vector]
    """Places of the shaft that an imager shows [m]."""

    @classmethod
    def of(cls, seen: Readings) -> "Placed":
        """From readings of many worlds."""
        columns = tuple(vectors.of(seen.tip_frame[:, :, column]) for column in range(3))
        coils = [vectors.of(seen.coils[:, coil]) for coil in range(seen.coils.shape[1])]
        return cls(vectors.of(seen.tip), (columns[0], columns[1], columns[2]), coils)

    def in_frame(self, away: Vector) -> Vector:
        """A vector in the tip's own axes."""
        up, left, ahead = self.frame
        return dot(up, away), dot(left, away), dot(ahead, away)

    def from_frame(self, own: Vector) -> Vector:
        """A vector given in the tip's own axes."""
        up, left, ahead = self.frame
        return add(add(times(own[0], up), times(own[1], left)), times(own[2], ahead))


def state(xp: Any, felt: Felt, wheels: tuple[Any, Any], action: tuple[Any, ...], speed: Any) -> tuple[Any, ...]:
    """What scope and hand can measure (`STATE`), entry by entry.

    Args:
        xp: numpy, or what writes programs.
        felt: what they measure.
        wheels: how far they are turned [1].
        action: the last one.
        speed: of insertion [m/s].
    """
    return (
        felt.bend[0] / 2.0,
        felt.bend[1] / 2.0,
        *wheels,
        felt.push_force / 20.0,
        felt.torque / 0.5,
        felt.hand_lead / 0.01,
        xp.sin(felt.roll),
        xp.cos(felt.roll),
        felt.insertion,
        speed / 0.1,
        *(part / 10.0 for part in felt.tip_force),
        *action,
    )


def imager(placed: Placed, tip_velocity: Vector) -> tuple[Any, ...]:
    """What a magnetic imager of the scope's shape shows, without its noise, entry by entry.

    Args:
        placed: where tip and shaft are.
        tip_velocity: of the tip, in the patient's frame [m/s].
    """
    shaft = (part / _REACH for coil in placed.coils for part in placed.in_frame(minus(coil, placed.tip)))
    return (
        *(part / _REACH for part in placed.tip),
        *placed.frame[2],
        *placed.frame[0],
        *(part / 0.1 for part in placed.in_frame(tip_velocity)),
        *shaft,
    )


def gas(pressure: Any, volume: Any, action: Any) -> tuple[Any, ...]:
    """What a learner with a gas action is shown of the gas (`GAS`), entry by entry.

    Args:
        pressure: at the tip, over that of the atmosphere [Pa].
        volume: of the colon's gas [m^3].
        action: the last one's share of gas [1].
    """
    return pressure / 3000.0, volume / 1e-3, action


def forgetting(times: tuple[float, ...], interval: float) -> tuple[float, ...]:
    """Share that each running mean forgets in an interval [s]: 1/e within each of `times` [s]."""
    return tuple(1.0 - math.exp(-interval / time) for time in times)


def renewed(mean: Any, rate: Any, now: Any) -> Any:
    """A running mean that has taken in what is measured now."""
    return mean + rate * (now - mean)


class Memory:
    """Running means of what the devices of all worlds have measured themselves, so that any device can have them."""

    def __init__(self, times: tuple[float, ...], worlds: int, size: int, interval: float) -> None:
        """Means of `size` entries that forget by 1/e within each of `times` [s], renewed every `interval` [s]."""
        self._rates = np.array(forgetting(times, interval), np.float32)[:, None, None]
        self._means = np.zeros((len(times), worlds, size), np.float32)

    def begin(self, worlds: Int[np.ndarray, " begun"], measured: Float[np.ndarray, "worlds size"]) -> None:
        """Forget everything in these worlds but what is measured now."""
        self._means[:, worlds] = measured[worlds]

    def add(self, measured: Float[np.ndarray, "worlds size"]) -> None:
        """Take in what is measured now."""
        self._means = renewed(self._means, self._rates, measured)

    def recent(self, measured: Float[np.ndarray, "worlds size"]) -> Float[np.ndarray, "worlds recent"]:
        """How what is measured now differs from each mean."""
        return bounded(np.concatenate(list(measured - self._means), axis=1))


def depth_weight(near: Any) -> Any:
    """How much a ray counts for where the lumen is deep, by its distance to the wall over `RANGE`."""
    return near**3 + 1e-6


def lumen(distances: Float[np.ndarray, "worlds rays"]) -> Float[np.ndarray, "worlds lumen"]:
    """Distances along rays, and where the lumen is deep: the rays' mean direction, weighted by the cube of distance."""
    near = distances / RANGE
    weight = depth_weight(near)
    towards = (weight @ ray_directions()[:, :2]) / weight.sum(axis=1, keepdims=True)
    return arrayed([near, towards])


def privileged(progress: Any, wall_force: Any, friction: Any, ahead: Sequence[Vector]) -> tuple[Any, ...]:
    """What no device knows, entry by entry; `ahead` are places of the centreline in the tip's frame [m]."""
    return progress, wall_force / 10.0, friction, *(part / RANGE for place in ahead for part in place)


def facing(xp: Any, view: Vector, behind: Vector, ahead: Vector) -> Any:
    """Cosine between the viewing direction and the centreline beside the tip, from one place to another [m]."""
    along = minus(ahead, behind)
    return dot(view, along) / xp.maximum(xp.sqrt(dot(along, along)), 1e-9)


def arrayed(entries: Sequence[Any]) -> Float[np.ndarray, "worlds entries"]:
    """Entries over worlds side by side, within the space's bounds, in single precision."""
    return bounded(np.column_stack(entries))


def clipped(xp: Any, value: Any) -> Any:
    """Within the space's bounds."""
    return xp.clip(value, -_LARGEST, _LARGEST)


def bounded(values: np.ndarray) -> np.ndarray:
    """Within the space's bounds, in single precision."""
    return clipped(np, values).astype(np.float32)


def bound() -> float:
    """Largest absolute value of an entry."""
    return _LARGEST
