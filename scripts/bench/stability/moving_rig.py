"""Several scopes in one colon that may move, each on its own mesentery."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene, entry_of
from haustra.models.wall import mesentery
from haustra.models.wall.lumen_table import Tables, lumen_table

OPTIONS = SceneOptions(wall_law="table", softening=False, mesentery=True, insertion_limit=1.0)
"""A metre of scope: more does not get in."""
INTERVAL = 0.02
"""Between two changes of inputs [s], or one time step if that is more."""

Act = Callable[[float], Controls]
"""Gives what the hands do at a time [s]; one row a world."""
Numbers = Mapping[str, float]
"""Numbers of a mesentery, by name; what is not named is as it is."""
Given = Mapping[str, np.ndarray | float]
"""Numbers of worlds, by their names in `haustra.envs.sim.linear.layout.WORLD`."""


@dataclass(frozen=True)
class Found:
    """What became of the worlds of one run."""

    healthy: np.ndarray
    """(worlds,)."""
    finite: bool
    """Whether all that can be read of all worlds is."""
    fastest: np.ndarray
    """(worlds,) largest generalised speed of the scope [rad/s or m/s]."""
    furthest: np.ndarray
    """(worlds,) largest displacement of the colon's axis [m]."""
    speed_end: np.ndarray
    """(worlds,) largest generalised speed in the last second [rad/s or m/s]."""


class MovingRig:
    """A colon, and that many worlds in it."""

    def __init__(self, colon: Colon, worlds: int) -> None:
        """Tabulate the colon; compilation comes with the first run."""
        self.worlds, self.colon = worlds, colon
        radius = named_design("adult").diameter / 2
        field = lumen_table(colon, device_radius=radius)
        self._place = entry_of(colon)
        self._arcs = np.asarray(field.tables.step * np.arange(int(field.tables.count)))
        self._points = field.tables.points
        self._width = np.interp(self._arcs, colon.centreline.arc, np.median(colon.radius, axis=1))
        self._fixed = field.seen_from(*self._place)
        self._backends: dict[float, LinearBackend] = {}

    def tables(self, numbers: Sequence[Numbers] = ()) -> Tables:
        """One wall, and a mesentery a world."""
        moving = [
            mesentery.hang(self._points, self._arcs, self._width, self.colon.segments, changed=changed)
            for changed in numbers or [{}] * self.worlds
        ]
        return self.fixed()._replace(
            mesentery=mesentery.stack([mesentery.seen_from(own, *self._place) for own in moving])
        )

    def fixed(self) -> Tables:
        """One wall, fixed in space, for all worlds."""
        each = np.ones(self.worlds, np.int32)
        return self._fixed._replace(
            step=float(self._fixed.step) * each,
            first=0 * each,
            count=int(self._fixed.count) * each,
            axes=np.tile(self._fixed.axes, (self.worlds, 1, 1)),
            device_radius=float(self._fixed.device_radius) * each,
        )

    def begin(self, timestep: float) -> LinearBackend:
        """Scopes at the anus and colons at rest, stepped in double precision by that time step [s]."""
        if timestep not in self._backends:
            options = replace(OPTIONS, timestep=timestep)
            scene = build_scene(self.colon, None, named_design("adult"), options, show_lumen=False)
            self._backends[timestep] = LinearBackend(scene, self.tables(), worlds=self.worlds, real=np.float64)
        backend, one = self._backends[timestep], np.ones(self.worlds)
        every = np.arange(self.worlds)
        backend.reset(every, every, Conditions(OPTIONS.friction * one, OPTIONS.wall_stiffness * one, one))
        return backend

    def run(self, stages: Iterable[tuple[Tables, Given, Act, float]], *, timestep: float) -> Found:
        """Drive worlds from the start through stages: colons, numbers, hands, and how long they last [s]."""
        backend, finite = self.begin(timestep), True
        count = max(1, round(INTERVAL / timestep))
        speeds, furthest = [], np.zeros(self.worlds)
        for tables, given, act, seconds in stages:
            load(backend, tables, given)
            for index in range(round(seconds / (count * timestep))):
                backend.step(act(index * count * timestep), count)
                finite &= all_finite(backend)
                state = backend.state()
                speeds.append(np.abs(state.qvel).max(axis=1))
                assert state.displacement is not None, "colons that are fixed in space"
                furthest = np.maximum(furthest, np.linalg.norm(state.displacement.pose[..., :3], axis=-1).max(axis=1))
        last = round(1 / (count * timestep))
        return Found(backend.alive, finite, np.max(speeds, axis=0), furthest, np.max(speeds[-last:], axis=0))


def load(backend: LinearBackend, tables: Tables, given: Given) -> None:
    """Hang colons otherwise, where they are, and change numbers of worlds."""
    assert tables.mesentery is not None, "colons that are fixed in space"
    backend.rehang(tables.mesentery)
    for name, values in given.items():
        backend.give(name, np.broadcast_to(np.asarray(values, float), backend.worlds))


def all_finite(backend: LinearBackend) -> bool:
    """Whether all that can be read of all worlds is."""
    return all(np.isfinite(part).all() for part in backend.read() if part is not None)
