"""Several scopes in one colon that may move, each on its own mesentery: one program for all time steps."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from haustra.envs.sim.device_arrays import on_device
from haustra.envs.sim.scope_reading import read_scope
from haustra.envs.sim.scope_values import Parameters, State
from haustra.envs.sim.scope_worlds import JaxScopes
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall import mesentery
from haustra.models.wall.lumen_table import Tables, lumen_table

OPTIONS = SceneOptions(wall_law="table", softening=False, mesentery=True, insertion_limit=1.0)
"""A metre of scope: more does not get in."""
INTERVAL = 0.02
"""Between two changes of inputs [s], or one time step if that is more."""

Act = Callable[[float], Controls]
"""Gives what the hands do at a time [s]; one row a world."""
Numbers = Mapping[str, float]
"""Of a mesentery, by name; what is not named is as it is."""


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
        self.worlds, self._colon = worlds, colon
        scene = self.scene(OPTIONS.timestep)
        field = lumen_table(colon, device_radius=scene.cable.radius)
        self._place = entry_of(colon)
        self._arcs = np.asarray(field.tables.step * np.arange(int(field.tables.count)))
        self._points = field.tables.points
        self._width = np.interp(self._arcs, colon.centreline.arc, np.median(colon.radius, axis=1))
        self._fixed = field.seen_from(*self._place)
        self._engine = engine = JaxScopes.of(scene)

        def advance(
            tables: Tables, parameters: Parameters, now: State, hands: Controls, step: Any, count: Any
        ) -> tuple[State, Any]:
            # All that depends on the time step is arithmetic, or in the parameters.
            own = replace(engine, timestep=step)
            now = own.steps(tables, parameters, now, hands, count)
            seen = own.read(parameters, tables, now)
            return now, jax.tree.reduce(jnp.logical_and, jax.tree.map(lambda part: jnp.isfinite(part).all(), seen))

        self._advance = jax.jit(advance)

    def scene(self, timestep: float) -> Scene:
        """The scope, modelled for that time step [s]."""
        return build_scene(
            self._colon, None, named_design("adult"), replace(OPTIONS, timestep=timestep), show_lumen=False
        )

    def tables(self, numbers: Sequence[Numbers] = ()) -> Tables:
        """One wall, and a mesentery a world."""
        moving = [
            mesentery.hang(self._points, self._arcs, self._width, self._colon.segments, changed=changed)
            for changed in numbers or [{}] * self.worlds
        ]
        each = np.ones(self.worlds, np.int32)
        return on_device(
            self._fixed._replace(
                step=float(self._fixed.step) * each,
                first=0 * each,
                count=int(self._fixed.count) * each,
                axes=np.tile(self._fixed.axes, (self.worlds, 1, 1)),
                device_radius=float(self._fixed.device_radius) * each,
                mesentery=mesentery.stack([mesentery.seen_from(own, *self._place) for own in moving]),
            )
        )

    def parameters(self, timestep: float, **changed: Any) -> Parameters:
        """Of all worlds, at that time step; `changed` as for `JaxScopes.parameters`."""
        scene = self.scene(timestep)
        which = np.arange(self.worlds, dtype=np.int32)
        return self._engine.parameters(scene, self.worlds, scope=read_scope(scene), colon=which, **changed)

    def begin(self, tables: Tables, parameters: Parameters) -> State:
        """Scopes at the anus, colons at rest."""
        return self._engine.begin(parameters, tables)

    def step(
        self, tables: Tables, parameters: Parameters, now: State, hands: Controls, *, timestep: float, count: int
    ) -> tuple[State, bool]:
        """That many time steps; and whether all that can be read is finite."""
        now, finite = self._advance(tables, parameters, now, hands, jnp.float32(timestep), count)
        return now, bool(finite)

    def run(self, stages: Iterable[tuple[Tables, Parameters, Act, float]], *, timestep: float) -> Found:
        """Drive worlds from the start through stages: colons and parameters, hands, and how long they last [s]."""
        now, finite = None, True
        count = max(1, round(INTERVAL / timestep))
        speeds, furthest = [], np.zeros(self.worlds)
        for tables, parameters, act, seconds in stages:
            now = self.begin(tables, parameters) if now is None else now
            for index in range(round(seconds / (count * timestep))):
                hands = act(index * count * timestep)
                now, sound = self.step(tables, parameters, now, hands, timestep=timestep, count=count)
                finite &= sound
                speeds.append(np.abs(np.asarray(now.qvel)).max(axis=1))
                assert now.displacement is not None, "colons that are fixed in space"
                place = np.linalg.norm(np.asarray(now.displacement.pose)[..., :3], axis=-1).max(axis=1)
                furthest = np.maximum(furthest, place)
        assert now is not None, "a run without stages"
        last = round(1 / (count * timestep))
        return Found(np.asarray(now.healthy), finite, np.max(speeds, axis=0), furthest, np.max(speeds[-last:], axis=0))
