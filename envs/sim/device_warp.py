"""Any device on MuJoCo Warp, through MJX, in many worlds: as `haustra.envs.sim.device_native`, on a GPU.

The planes are placed, and the device asked, by the same functions as natively, in JAX. Without a GPU the kernels run on
the CPU, slowly: for tests.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from haustra.envs.sim.device_arrays import on_device, tree_where
from haustra.envs.sim.device_native import look_ahead
from haustra.envs.sim.precision import precise
from haustra.envs.sim.state import SPEED_LIMIT
from haustra.envs.sim.warp_scopes import CONTACT_ROWS, filled, for_warp, with_columns
from haustra.errors import UnsupportedSceneError
from haustra.models.device_scene import DeviceScene
from haustra.models.devices.base import DeviceReadings, State
from haustra.models.wall.law import normal_force, soft_contact
from haustra.models.wall.lumen_table import Tables, query
from haustra.models.wall.plane_pose import plane_pose

Array = Any
_USED = ("qpos", "qvel", "act", "qacc_warmstart", "geom_xpos", "site_xpos", "site_xmat", "actuator_force")
"""Fields of MuJoCo's data that go from step to step."""


class Worlds(NamedTuple):
    """Everything that changes, worlds first."""

    data: dict[str, Array]
    """Fields of MuJoCo's data by name, those of `_USED`."""
    before: Array
    """(worlds, spheres, 3) where the spheres were before the last step [m]."""
    arcs: Array
    """(worlds, spheres) [m]."""
    depth: Array
    """(worlds, spheres) [m]."""
    normal: Array
    """(worlds, spheres, 3) force of the wall [N]."""
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
    host: mujoco.MjModel
    """Compiled for the CPU."""
    model: Any
    """Compiled model on the GPU for Warp, as MJX has it."""
    start: dict[str, np.ndarray]
    """What a world begins with, as MuJoCo's CPU engine computes it."""
    spheres: np.ndarray
    """Numbers of the spheres' geoms."""
    rows: int
    """Constraint rows kept for each world: as many as there can be."""

    name = "warp"

    @classmethod
    def of(cls, scene: DeviceScene, tables: Tables) -> "WarpDevice":
        """Take a scene and the colons' tables.

        Raises:
            UnsupportedSceneError: when Warp has not what the device is made of.
        """
        if scene.options.mesentery:
            raise UnsupportedSceneError(
                "The backend 'warp' cannot honour scene.mesentery = True for a device; 'native' can."
            )
        if scene.device.has_treads:
            raise UnsupportedSceneError(
                f"The backend 'warp' cannot honour the treads of a device of kind '{scene.device.kind}'; 'native' can."
            )
        host = for_warp(scene.compile())
        try:
            model = mjx.put_model(host, impl="warp").tree_replace({"opt._impl.warn_overflow": 0})
        except (NotImplementedError, ValueError) as error:
            kind = scene.device.kind
            raise UnsupportedSceneError(
                f"The backend 'warp' cannot honour a device of kind '{kind}': {error}"
            ) from error
        count = len(scene.handles.samples)
        planes = [f"wall/plane_{index:04d}_0" for index in range(count)]
        assert [host.pair(name).id for name in planes] == list(range(host.npair)), "one pair a sphere, in their order"
        assert [host.body(name).mocapid[0] for name in planes] == list(range(host.nmocap)), "so are the planes"
        data = mujoco.MjData(host)
        mujoco.mj_forward(host, data)
        start = {name: np.array(getattr(data, name), np.float32) for name in _USED}
        start["site_xmat"] = start["site_xmat"].reshape(-1, 3, 3)
        spheres = np.array([host.geom(f"wall/sphere_{index:04d}").id for index in range(count)])
        rows = CONTACT_ROWS * count + int(host.jnt_limited.sum())
        return cls(scene, on_device(tables), host, model, start, spheres, rows)

    def begin(self, conditions: Conditions) -> Worlds:
        """All devices at the anus."""
        worlds = len(conditions.colon)
        data = {name: jnp.broadcast_to(value, (worlds, *value.shape)) for name, value in self.start.items()}
        centres, pose = data["geom_xpos"][:, self.spheres], self.scene.pose
        arcs = (centres - jnp.asarray(pose.position, jnp.float32)) @ jnp.asarray(pose.frame[:, 2], jnp.float32)
        zeros = jnp.zeros(worlds)
        return Worlds(
            data, centres, arcs, jnp.full(arcs.shape, -1.0), jnp.zeros_like(centres), zeros, jnp.ones(worlds, bool)
        )

    @precise
    def step(self, conditions: Conditions, now: Worlds, commands: Array, count: Any) -> Worlds:
        """Advance by `count` time steps; worlds that are lost stay as they were."""
        sound = jnp.isfinite(commands).all(axis=1)
        device, handles = self.scene.device, self.scene.handles
        asked = jnp.where(sound[:, None], commands, 0.0)
        ctrl = device.control(jnp, self.host, handles, self.state(now), asked).astype(jnp.float32)
        contacts = self._model_of(conditions)
        now = now._replace(healthy=now.healthy & sound)

        def one(_: Any, both: tuple[Worlds, Any]) -> tuple[Worlds, Any]:
            return self._step(conditions, *both, ctrl, contacts)

        return jax.lax.fori_loop(0, count, one, (now, self._data(len(now.time))))[0]

    def read(self, conditions: Conditions, now: Worlds) -> DeviceReadings:
        """What every device can be told by."""
        state = self.state(now)
        tip = now.data["site_xpos"][:, self._tip]
        links = jnp.einsum("wsi,sb->wbi", now.normal, jnp.asarray(self.scene.members, jnp.float32))
        colon = conditions.colon * len(self.scene.radii)
        return DeviceReadings(
            time=now.time,
            tip=tip,
            tip_frame=state.tip_frame,
            tip_arc=state.tip_arc,
            ahead=look_ahead(jnp, self.tables, colon, tip, state.tip_arc),
            wall_force=jnp.sqrt((links**2).sum(axis=2)).max(axis=1),
            deepest=now.depth.max(axis=1),
        )

    def readings(self, now: Worlds) -> dict[str, Array]:
        """The device's own quantities."""
        return self.scene.device.read(jnp, self.host, self.scene.handles, self.state(now))

    def state(self, now: Worlds) -> State:
        """What a device may look at."""
        data, nose = now.data, float(self.host.geom_size[self.spheres[-1], 0])
        frame = data["site_xmat"][:, self._tip].reshape(-1, 3, 3)
        return State(data["qpos"], data["qvel"], data["act"], frame, now.arcs[:, -1] + nose, data["actuator_force"])

    @property
    def _tip(self) -> int:
        return self.host.site(self.scene.handles.tip).id

    def _step(self, conditions: Conditions, now: Worlds, data: Any, ctrl: Array, contacts: Any) -> tuple[Worlds, Any]:
        h, entry = self.host.opt.timestep, self.scene.pose
        radius = jnp.asarray(self.host.geom_size[self.spheres, 0], jnp.float32)
        seen = now.data["geom_xpos"][:, self.spheres]
        centres = 2 * seen - now.before
        found = query(jnp, self._tables_of(conditions), centres, now.arcs)
        before_anus = found.arcs <= 0
        along = (centres - jnp.asarray(entry.position, jnp.float32)) @ jnp.asarray(entry.frame[:, 2], jnp.float32)
        leaving, stiffness = (now.depth - found.depth) / h, conditions.stiffness[:, None]
        damper = stiffness * (self.scene.options.wall_damping_time + h)
        force = normal_force(jnp, stiffness * now.depth, damper, leaving)
        kept = {name: now.data[name] for name in ("qpos", "qvel", "act", "qacc_warmstart")}
        pose = plane_pose(jnp, centres, radius, found.depth, found.inwards)
        model, axes = contacts
        model, axes = model.replace(pair_margin=pose.margin), axes.replace(pair_margin=0)
        step = jax.vmap(mjx.step, in_axes=(axes, 0))
        done = step(model, data.replace(**kept, ctrl=ctrl, mocap_pos=pose.position, mocap_quat=pose.turn))
        after = Worlds(
            {name: getattr(done, name).reshape(now.data[name].shape) for name in _USED},
            seen,
            jnp.where(before_anus, along, found.arcs),
            found.depth,
            force[..., None] * found.inwards,
            now.time + h,
            now.healthy,
        )
        qpos, qvel = after.data["qpos"], after.data["qvel"]
        sound = jnp.isfinite(qpos).all(axis=1) & (jnp.abs(qvel).max(axis=1) < SPEED_LIMIT) & now.healthy
        return tree_where(sound, after, now)._replace(healthy=sound), done

    def _tables_of(self, conditions: Conditions) -> Tables:
        """One table a sphere: that of its colon for its radius."""
        number = conditions.colon[:, None] * len(self.scene.radii) + self.scene.groups
        chosen = {name: getattr(self.tables, name)[number] for name in ("step", "first", "count")}
        return self.tables._replace(**chosen)

    def _model_of(self, conditions: Conditions) -> tuple[Any, Any]:
        """The model with each world's own contacts, and which of its arrays have one entry a world."""
        inverse = jnp.asarray(self.host.body_invweight0[self.host.geom_bodyid[self.spheres], 0], jnp.float32)
        stiffness, h = conditions.stiffness[:, None], self.host.opt.timestep
        damper = stiffness * (self.scene.options.wall_damping_time + h)
        soft = soft_contact(jnp, inverse, stiffness, damper, timestep=h)
        own = {
            "pair_friction": with_columns(self.model.pair_friction, conditions.friction[:, None, None], 2),
            "pair_solref": soft.solref,
            "pair_solreffriction": soft.sliding,
            "pair_solimp": with_columns(self.model.pair_solimp, soft.impedance[..., None], 2),
        }
        axes = jax.tree.map(lambda _: None, self.model)
        return self.model.replace(**own), axes.replace(**dict.fromkeys(own, 0))

    def _data(self, worlds: int) -> Any:
        """What MuJoCo Warp works in."""
        with jax.ensure_compile_time_eval():
            one = mjx.make_data(self.host, impl="warp", naconmax=worlds * len(self.spheres), njmax=self.rows)
        one = jax.tree.map(filled, one)
        return jax.vmap(lambda _: one)(jnp.arange(worlds))


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
                **backend.readings(now),
            }
            return (now, memory), kept

        count = max(1, round(seconds / (steps * backend.scene.options.timestep)))
        return jax.lax.scan(decide, (now, jnp.zeros(len(now.time))), None, length=count)[1]

    kept = run(conditions, backend.begin(conditions))
    return {name: np.asarray(value).T for name, value in kept.items()}
