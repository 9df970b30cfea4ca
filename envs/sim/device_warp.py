"""Any device on MuJoCo Warp, through MJX, in many worlds: as `haustra.envs.sim.device_native`, on a GPU.

The planes are placed, and colons give way, as those of scopes (`haustra.envs.sim.warp_planes`); the device is asked by
the same functions as natively, in JAX. Without a GPU the kernels run on the CPU, slowly: for tests.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int
from mujoco import mjx

from haustra.envs.sim.device_arrays import on_device, tree_where
from haustra.envs.sim.device_native import TREAD_INTERVAL, bends_behind, look_ahead
from haustra.envs.sim.device_worlds import require_on_warp
from haustra.envs.sim.precision import precise
from haustra.envs.sim.warp_planes import Contacts, WarpPlanes, sound
from haustra.models.device_scene import DeviceScene
from haustra.models.devices.base import DeviceReadings, State, Treads
from haustra.models.wall import moving_colon
from haustra.models.wall.lumen_table import Tables, pick
from haustra.models.wall.moving_colon import AxisDisplacement

Array = Any
_KEPT = ("qpos", "qvel", "act", "qacc_warmstart")
_USED = (*_KEPT, "site_xpos", "site_xmat", "actuator_force")
"""Fields of MuJoCo's data that go from step to step."""


class Worlds(NamedTuple):
    """Everything that changes, worlds first."""

    data: dict[str, Array]
    """Fields of MuJoCo's data by name, those of `_USED`."""
    arcs: Array
    """(worlds, spheres) [m]."""
    depth: Array
    """(worlds, spheres) [m]."""
    force: Array
    """(worlds, spheres, 3) normal force of the wall [N]."""
    rubbed: Array
    """(worlds, spheres, 3) friction of the wall [N]."""
    displacement: AxisDisplacement | None
    """Where the colons have moved to; None where they are fixed."""
    time: Array
    """(worlds,) [s]."""
    healthy: Array
    """(worlds,)."""


class Conditions(NamedTuple):
    """What differs between worlds."""

    colon: Array
    """(worlds,) number of the colon."""
    friction: Array
    """(worlds,) [1]."""
    stiffness: Array
    """(worlds,) [N/m]."""


@dataclass(frozen=True, eq=False)
class WarpDevice:
    """One device in colons that take turns before it."""

    scene: DeviceScene
    tables: Tables
    """On JAX's device."""
    wall: WarpPlanes
    """The compiled model, and its planes."""
    start: dict[str, np.ndarray]
    """What a world begins with, as MuJoCo's CPU engine computes it."""
    arcs: np.ndarray
    """(colons, spheres) arc lengths at the start [m]."""

    name = "warp"

    @classmethod
    def of(cls, scene: DeviceScene, tables: Tables, *, starts: Sequence[float] | None = None) -> "WarpDevice":
        """Take a scene and the colons' tables.

        Args:
            scene: device and options.
            tables: the colons (`haustra.models.device_scene.device_tables`).
            starts: arc length of the scene's pose in each colon [m]; that of the pose when None.

        Raises:
            UnsupportedSceneError: when Warp has not what the device is made of.
        """
        require_on_warp(scene)
        pose, samples = scene.pose, scene.handles.samples
        moves, what = scene.options.mesentery, f"a device of kind '{scene.device.kind}'"
        surrounded = scene.options.abdomen.surrounds
        about = {"moves": moves, "surrounded": surrounded, "runs": scene.device.has_treads}
        wall = WarpPlanes.of(scene.compile(), len(samples), what=what, **about)
        data = mujoco.MjData(wall.host)
        mujoco.mj_forward(wall.host, data)
        start = {name: np.array(getattr(data, name), np.float32) for name in _USED}
        start["site_xmat"] = start["site_xmat"].reshape(-1, 3, 3)
        colons = len(tables.count) // len(scene.radii)
        begun = np.array(starts) if starts else np.full(colons, pose.arc)
        arcs = np.add.outer(begun, (data.geom_xpos[wall.spheres] - pose.position) @ pose.frame[:, 2])
        return cls(scene, on_device(tables), wall, start, np.asarray(arcs, np.float32))

    def check(self, conditions: Conditions) -> None:
        """Refuse conditions that MuJoCo's contacts cannot honour.

        Raises:
            InvalidOptionError: when MuJoCo would clamp the wall's law.
        """
        self.wall.check(self._own("stiffness", np.asarray(conditions.stiffness)), self.scene.options.wall_damping_time)

    def begin(self, conditions: Conditions) -> Worlds:
        """All devices where they begin, in colons at rest."""
        worlds, hung = len(conditions.colon), self.tables.mesentery
        data = {name: jnp.broadcast_to(value, (worlds, *value.shape)) for name, value in self.start.items()}
        arcs = jnp.asarray(self.arcs)[conditions.colon]
        displacement = hung and moving_colon.at_rest(jnp, hung, worlds, arcs.dtype)
        zeros = jnp.zeros(worlds)
        return Worlds(
            data=data,
            arcs=arcs,
            depth=jnp.full(arcs.shape, -1.0),
            force=jnp.zeros((*arcs.shape, 3)),
            rubbed=jnp.zeros((*arcs.shape, 3)),
            displacement=displacement,
            time=zeros,
            healthy=jnp.ones(worlds, bool),
        )

    @precise
    def step(self, conditions: Conditions, now: Worlds, commands: Array, count: Any) -> Worlds:
        """Advance by `count` time steps; worlds that are lost stay as they were."""
        told = jnp.isfinite(commands).all(axis=1)
        asked = jnp.where(told[:, None], commands, 0.0)
        now = now._replace(healthy=now.healthy & told)
        tables, contacts = self._tables_of(conditions.colon), self._contacts(conditions)
        every = max(1, round(TREAD_INTERVAL / self.wall.timestep))

        def one(number: Any, carried: tuple[Worlds, Any, Any]) -> tuple[Worlds, Any, Any]:
            now, data, driven = carried
            if self.scene.device.has_treads:
                again = lambda _: self._driven(conditions, now, asked)  # noqa: E731
                due = (number > 0) & (number % every == 0)
                driven = jax.lax.cond(due, again, lambda before: before, driven)
            return *self._step(tables, contacts, now, data, driven), driven

        begun = now, self.wall.data(len(now.time)), self._driven(conditions, now, asked)
        return jax.lax.fori_loop(0, count, one, begun)[0]

    def _driven(self, conditions: Conditions, now: Worlds, asked: Array) -> tuple[Array, Treads | None]:
        """Controls of the actuators, and how treads run."""
        device, about = self.scene.device, (jnp, self.wall.host, self.scene.handles, self.state(conditions, now), asked)
        ctrl = device.control(*about).astype(jnp.float32)
        treads = Treads(*(part.astype(jnp.float32) for part in device.treads(*about))) if device.has_treads else None
        return ctrl, treads

    def read(self, conditions: Conditions, now: Worlds) -> DeviceReadings:
        """What every device can be told by."""
        state = self.state(conditions, now)
        tip = now.data["site_xpos"][:, self._tip]
        links = jnp.einsum("wsi,sb->wbi", now.force, jnp.asarray(self.scene.members, jnp.float32))
        colon = conditions.colon * len(self.scene.radii)
        moved = now.displacement and now.displacement.pose
        return DeviceReadings(
            time=now.time,
            tip=tip,
            tip_frame=state.tip_frame,
            tip_arc=state.tip_arc,
            ahead=look_ahead(jnp, self.tables, colon, tip, state.tip_arc, moved),
            wall_force=jnp.sqrt((links**2).sum(axis=2)).max(axis=1),
            deepest=now.depth.max(axis=1),
        )

    def readings(self, conditions: Conditions, now: Worlds) -> dict[str, Array]:
        """The device's own quantities."""
        return self.scene.device.read(jnp, self.wall.host, self.scene.handles, self.state(conditions, now))

    def state(self, conditions: Conditions, now: Worlds) -> State:
        """What a device may look at."""
        data, arcs = now.data, now.arcs[:, -1] + float(self.wall.radius[-1])
        moved = now.displacement and now.displacement.pose
        bends = bends_behind(jnp, self.tables, conditions.colon * len(self.scene.radii), arcs, moved)
        frame = data["site_xmat"][:, self._tip]
        return State(
            data["qpos"],
            data["qvel"],
            data["act"],
            frame,
            arcs,
            data["actuator_force"],
            pressed=jnp.linalg.norm(now.force, axis=2),
            rubbed=now.rubbed,
            friction=self._own("friction", conditions.friction),
            bends=bends,
        )

    @property
    def _tip(self) -> int:
        return self.wall.host.site(self.scene.handles.tip).id

    def _step(
        self, tables: Tables, contacts: Contacts, now: Worlds, data: Any, driven: tuple[Array, Treads | None]
    ) -> tuple[Worlds, Any]:
        wall, (ctrl, treads) = self.wall, driven
        data = data.replace(ctrl=ctrl, **{name: now.data[name] for name in _KEPT})
        posed = jax.vmap(mjx.kinematics, in_axes=(None, 0))(wall.model, data)
        places = posed.geom_xpos[:, wall.spheres]
        links = wall.host.geom_bodyid[wall.spheres]
        centres = posed.xipos[:, links] if self.scene.device.is_shaft else None
        radius = jnp.asarray(wall.radius, jnp.float32)[None]
        about = tables, now.displacement, places, now.arcs, radius, data, now.healthy, now.time
        done = wall.step(contacts, *about, treads, centres)
        after = Worlds(
            data={name: getattr(done.data, name).reshape(now.data[name].shape) for name in _USED},
            arcs=done.arcs,
            depth=done.depth,
            force=done.normal[..., None] * done.inwards,
            rubbed=-(done.on_wall + done.normal[..., None] * done.inwards),
            displacement=done.displacement,
            time=now.time + wall.timestep,
            healthy=now.healthy,
        )
        healthy = now.healthy & sound(after.data["qvel"], after.data["qpos"], after.displacement)
        return tree_where(healthy, after, now)._replace(healthy=healthy), done.data

    def _tables_of(self, colon: Array) -> Tables:
        """For each sphere the table of its world's colon for its radius."""
        radii = len(self.scene.radii)
        number = colon[:, None] * radii + self.scene.groups
        chosen = {name: getattr(self.tables, name)[number] for name in ("step", "first", "count", "device_radius")}
        return pick(self.tables, colon * radii)._replace(**chosen)

    def _contacts(self, conditions: Conditions) -> Contacts:
        """The wall's law, of spheres their own where they have one."""
        stiffness, friction = (self._own(name, getattr(conditions, name)) for name in ("stiffness", "friction"))
        return self.wall.contacts(stiffness, jnp.full((1, 1), self.scene.options.wall_damping_time), friction)

    def _own(self, name: str, of_worlds: Array) -> Array:
        """A number of the wall's law at each sphere (worlds, spheres)."""
        own = self.scene.own(name)
        return jnp.where(np.isnan(own), of_worlds[:, None], own.astype(np.float32))


class WarpDeviceWorlds:
    """Worlds of one device on Warp (`haustra.envs.sim.device_worlds`). Only commands and readings travel."""

    name = "warp"

    def __init__(
        self, scene: DeviceScene, tables: Tables, *, worlds: int = 1, starts: Sequence[float] | None = None
    ) -> None:
        """As `haustra.envs.sim.device_native.NativeDevice`; compilation comes with the first step."""
        self._device, options = WarpDevice.of(scene, tables, starts=starts), scene.options
        numbers = (jnp.full(worlds, float(value)) for value in (options.friction, options.wall_stiffness))
        self._conditions = Conditions(jnp.zeros(worlds, jnp.int32), *numbers)
        self._device.check(self._conditions)
        self._now, self._step = self._device.begin(self._conditions), jax.jit(self._device.step)
        self._read = jax.jit(lambda *now: (self._device.read(*now), self._device.readings(*now)))

    def reset(
        self,
        worlds: Int[np.ndarray, " reset"],
        colons: Int[np.ndarray, " reset"],
        *,
        friction: Float[np.ndarray, " reset"],
        wall_stiffness: Float[np.ndarray, " reset"],
    ) -> None:
        """Put the devices of some worlds to the anus of the colons of those numbers."""
        changed = zip(self._conditions, (colons, friction, wall_stiffness), strict=True)
        conditions = Conditions(*(old.at[worlds].set(jnp.asarray(new, old.dtype)) for old, new in changed))
        self._device.check(conditions)
        anew = jnp.zeros(len(conditions.colon), bool).at[worlds].set(True)
        self._conditions, self._now = conditions, tree_where(anew, self._device.begin(conditions), self._now)

    def step(self, commands: Float[np.ndarray, "worlds channels"], count: int) -> Bool[np.ndarray, " worlds"]:
        """Advance by `count` time steps; False for worlds that are lost, which stand still from then."""
        self._now = self._step(self._conditions, self._now, jnp.asarray(commands, jnp.float32), count)
        return np.array(self._now.healthy)

    def read(self) -> DeviceReadings:
        """What every device can be told by, in double precision."""
        return self._told()[0]

    def readings(self) -> dict[str, Float[np.ndarray, " worlds"]]:
        """The device's own quantities, by name."""
        return self._told()[1]

    @property
    def displacement(self) -> Float[np.ndarray, "worlds nodes 7"] | None:
        """Displacements of the colons' axes [m]; None where they are fixed."""
        return self._now.displacement and np.asarray(self._now.displacement.pose, float)

    def _told(self) -> tuple[DeviceReadings, dict[str, Array]]:
        found = jax.device_get(self._read(self._conditions, self._now))
        return jax.tree.map(lambda part: np.asarray(part, float), found)


def drive_worlds(backend: WarpDevice, conditions: Conditions, *, seconds: float, interval: float) -> dict[str, Array]:
    """Let the device's own driver drive all worlds; records of each control interval, worlds first.

    Args:
        backend: the device and its colons.
        conditions: of the worlds.
        seconds: simulated time [s].
        interval: between two decisions [s].
    """
    steps = max(1, round(interval / backend.scene.options.timestep))
    device = backend.scene.device

    @partial(jax.jit)
    def run(conditions: Conditions, now: Worlds) -> Any:
        def decide(carry: Any, _: Any) -> Any:
            now, memory = carry
            commands, memory = device.drive(jnp, backend.read(conditions, now), memory)
            now = backend.step(conditions, now, commands.astype(jnp.float32), steps)
            seen = backend.read(conditions, now)
            kept = {
                "time": seen.time,
                "tip_arc": seen.tip_arc,
                "wall_force": seen.wall_force,
                "deepest": seen.deepest,
                "healthy": now.healthy,
                **backend.readings(conditions, now),
            }
            return (now, memory), kept

        count = max(1, round(seconds / (steps * backend.scene.options.timestep)))
        return jax.lax.scan(decide, (now, jnp.zeros(len(now.time))), None, length=count)[1]

    kept = run(conditions, backend.begin(conditions))
    return {name: np.asarray(value).T for name, value in kept.items()}
