"""Many scopes at once on CPU threads, each in a colon of its own: hands in, what the scopes do out.

The wall is no part of the model. Before every step the place of each sphere of each scope is looked up in the table of
its colon (`haustra.models.wall.lumen_table`), and a tangent plane is put there, so that MuJoCo does the contact,
implicitly and with the exact stiffness of `haustra.models.wall.law`. Worlds share one model: colon, friction, wall
stiffness and the shaft's stiffness are numbers of each.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import final

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.sim.backend import AbstractBackend
from haustra.envs.sim.capabilities import require_supported
from haustra.envs.sim.conditions import Conditions, Snapshot
from haustra.envs.sim.log import log_to_stderr_only
from haustra.envs.sim.state import Controls, Readings, refuse_others
from haustra.envs.sim.thread_slice import ThreadSlice
from haustra.models.scene import Scene
from haustra.models.wall import moving_colon
from haustra.models.wall.law import WallContact
from haustra.models.wall.lumen_table import Tables, pick
from haustra.models.wall.planes import add_felt, add_planes, with_friction

SOLVER_TOLERANCE = 1e-8
"""Tolerance of the dual solver, MuJoCo's own. At 1e-5 steps take 4 % less time, and scopes that a fold holds let go at
another time."""


@final
class NativeBackend(AbstractBackend):
    """Many scopes on MuJoCo's CPU engine, on as many threads as asked for."""

    name = "native-batch"
    on_device = False
    traces_pictures = False

    def __init__(self, scene: Scene, tables: Tables, *, worlds: int, threads: int = 1) -> None:
        """Compile one model for all worlds.

        Args:
            scene: scope and options, built with wall_law "table" for any of the colons.
            tables: the colons, seen from their entries (`LumenTable.seen_from`) and stacked.
            worlds: how many.
            threads: each steps its own part of the worlds.

        Raises:
            UnsupportedSceneError: when the scene has what this backend cannot honour.
        """
        require_supported(scene, self.name)
        log_to_stderr_only()
        self.scene, self.tables, self.worlds = scene, tables, worlds
        self.model = batch_model(scene, felt=scene.options.mesentery)
        self.model.flg_surfacevel = scene.options.mesentery  # before it is copied: walls that move drag by friction
        parts = np.array_split(np.arange(worlds), min(threads, worlds))
        self._slices = [slice(int(part[0]), int(part[-1]) + 1) for part in parts]
        self._shards = [ThreadSlice(scene, self.model, tables, len(part)) for part in parts]
        self._pool = ThreadPoolExecutor(len(parts) - 1) if len(parts) > 1 else None
        self._case = np.zeros(worlds, int)
        self.read().checked()  # the shapes stay

    def reset(self, worlds: Int[np.ndarray, " reset"], case: Int[np.ndarray, " reset"], conditions: Conditions) -> None:
        """Lay the scopes of some worlds straight, tips at the start depth, in the colons of those numbers."""
        self._case[worlds] = case
        for part, shard in zip(self._slices, self._shards, strict=True):
            mine = (worlds >= part.start) & (worlds < part.stop)
            if mine.any():
                shard.reset(worlds[mine] - part.start, case[mine], conditions.of(mine))

    def step(self, inputs: Controls, count: int) -> Bool[np.ndarray, " worlds"]:
        """Advance all worlds by `count` time steps; False for those that have diverged, which stand still from then."""
        refuse_others(inputs, self.worlds)

        def advance(index: int) -> None:
            part = self._slices[index]
            self._shards[index].step(inputs.push_rate[part], inputs.roll_rate[part], inputs.pulls[part], count)

        others = [self._pool.submit(advance, index) for index in range(1, len(self._shards))] if self._pool else []
        advance(0)
        for other in others:
            other.result()
        return np.concatenate([shard.healthy for shard in self._shards])

    def read(self) -> Readings:
        """What can be read off at the end of the last step."""
        parts = [shard.read() for shard in self._shards]
        read = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        return Readings(**read, displacement=self.displacement)

    @property
    def displacement(self) -> Float[np.ndarray, "worlds nodes 7"] | None:
        """Displacements of the colons' axes at the beginning of the last time step [m]; None where they are fixed."""
        found = [shard.displacement for shard in self._shards]
        return np.concatenate([part for part in found if part is not None]) if found[0] is not None else None

    def way_ahead(self, distances: Float[np.ndarray, " places"]) -> Float[np.ndarray, "worlds places 3"]:
        """As `AbstractBackend.way_ahead`."""
        tables, arcs = pick(self.tables, self._case), self.read().tip_arc[:, None] + distances
        return moving_colon.axis_at(np, tables, self.displacement, arcs)

    def positions(self) -> Float[np.ndarray, "worlds joints"]:
        """Joint positions of all scopes, as MuJoCo counts them."""
        return np.concatenate([shard.positions() for shard in self._shards])

    def snapshot(self, world: int) -> Snapshot:
        """Where one world is now."""
        return self._shard_of(world)[0].snapshot(self._shard_of(world)[1])

    def restore(self, world: int, snapshot: Snapshot) -> None:
        """Put one world, which was reset to the same colon, where another was."""
        shard, row = self._shard_of(world)
        shard.restore(row, snapshot)

    def world_data(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one world as MuJoCo's own values, to draw or to check."""
        shard, row = self._shard_of(world)
        return shard.world_data(row)

    def _shard_of(self, world: int) -> tuple[ThreadSlice, int]:
        index = next(i for i, part in enumerate(self._slices) if part.start <= world < part.stop)
        return self._shards[index], world - self._slices[index].start

    def close(self) -> None:
        """End the threads."""
        if self._pool:
            self._pool.shutdown()


def batch_model(scene: Scene, *, felt: bool = False) -> mujoco.MjModel:
    """The scene's scope entering at the origin along z, each of its spheres with a plane to be placed.

    `felt` lets MuJoCo tell what spheres do to the wall.
    """
    spec = mujoco.MjSpec.from_string(scene.spec.to_xml())
    root = spec.body("scope/root")
    root.pos = [0, 0, scene.options.start_depth - scene.cable.length]
    root.quat = [1, 0, 0, 0]
    bare = spec.compile()
    contact: WallContact = scene.options.contact
    add_planes(spec, bare, scene.samples, contact, timestep=scene.options.timestep, planes=1)
    if felt:
        add_felt(spec, len(scene.samples))
    spec.option.solver = mujoco.mjtSolver.mjSOL_PGS
    spec.option.tolerance = SOLVER_TOLERANCE
    return with_friction(spec.compile())


def posed(scene: Scene, qpos: Float[np.ndarray, " positions"]) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """`batch_model`, and data of it with the scope as those positions say."""
    model = batch_model(scene)
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return model, data
