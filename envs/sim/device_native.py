"""Any device on MuJoCo's CPU engine, commands in, readings out: in many worlds by the table, in one on other walls."""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int
from mujoco.batch import Batch

from haustra.envs.sim.gas import run_gas
from haustra.envs.sim.log import log_to_stderr_only
from haustra.envs.sim.native import FATAL_WARNINGS
from haustra.envs.sim.scene_wall import SceneWall, SceneWorld
from haustra.envs.sim.state import SPEED_LIMIT
from haustra.envs.sim.table_planes import TablePlanes
from haustra.errors import UnsupportedSceneError
from haustra.models.anatomy.colon import Colon
from haustra.models.device_scene import DeviceScene
from haustra.models.devices.base import BENDS, LOOK_AHEAD, DeviceReadings, State
from haustra.models.scene import SceneOptions
from haustra.models.wall.lumen_table import Tables, pick, put_distended
from haustra.models.wall.moving_colon import axis_at

TREAD_INTERVAL = 4e-3
"""Time between two looks at what treads do [s]; engineering choice: a fraction of any time in which they answer."""


class DeviceGas:
    """Gas in the colon of one world, which the device lets in at its tip; it moves the tables of all its spheres."""

    def __init__(self, colon: Colon, options: SceneOptions, tables: Tables) -> None:
        """Fill a colon that is one table a radius of the device's spheres, stacked."""
        first, count = np.asarray(tables.first), np.asarray(tables.count)
        self._walls = [tables.wall[begin : begin + size] for begin, size in zip(first, count, strict=True)]
        self._rest, self._radii = [wall.copy() for wall in self._walls], np.asarray(tables.device_radius, float)
        self.run = run_gas(colon, options, stations=int(count[-1]), device_radius=float(self._radii[-1]))

    def advance(self, tip_arc: float, seconds: float) -> bool:
        """Let gas in where the tip is, and let it move; says whether the wall is another than before."""
        return self.run.advance(tip_arc, seconds)

    def place(self) -> float:
        """Put the tables where gas holds the wall; returns the wall's stiffness [N/m]."""
        for wall, rest, radius in zip(self._walls, self._rest, self._radii, strict=True):
            put_distended(wall, rest, self.run.widths, device_radius=float(radius))
        return self.run.stiffness


class NativeDevice:
    """Worlds of one device, each in a colon, with friction and wall stiffness of its own."""

    name = "native"

    def __init__(
        self,
        scene: DeviceScene,
        tables: Tables,
        *,
        worlds: int = 1,
        threads: int = 1,
        starts: Sequence[float] | None = None,
    ) -> None:
        """Compile one model for all worlds.

        Args:
            scene: device and options (`haustra.models.device_scene.build_device_scene`).
            tables: the colons (`haustra.models.device_scene.device_tables`).
            worlds: how many.
            threads: of MuJoCo.
            starts: arc length of the scene's pose in each colon [m]; that of the pose when None.

        Raises:
            UnsupportedSceneError: for several worlds of a wall law that has one.
        """
        log_to_stderr_only()
        self.scene, self.worlds, self._tables = scene, worlds, tables
        law, rubs = scene.options.wall_law, scene.device.has_treads or scene.options.mesentery
        if law != "table" and worlds > 1:
            raise UnsupportedSceneError(
                f"Wall law '{law}' is stepped in one world at a time: many need the law 'table'."
            )
        self.model = model = scene.compile(felt=rubs and law == "table")
        model.flg_surfacevel = rubs  # before it is copied: treads, and walls that move, drag by friction
        self._batch = batch = Batch(model, worlds, nthread=threads) if law == "table" else SceneWorld(model)
        self._qpos, self._qvel, self._act = (batch.bind(name) for name in ("qpos", "qvel", "act"))
        self._ctrl, self._time, self._force = (batch.bind(name) for name in ("ctrl", "time", "actuator_force"))
        self._actuator_speed = batch.bind("actuator_velocity")
        self._site_xpos, self._site_xmat = batch.bind("site_xpos"), batch.bind("site_xmat")
        self._xpos = batch.bind("geom_xpos")
        self._tip = model.site(scene.handles.tip).id
        if isinstance(batch, SceneWorld):
            self._wall = SceneWall(batch, scene, tables)
        else:
            self._wall = TablePlanes(
                batch,
                model,
                tables,
                worlds=worlds,
                count=len(scene.handles.samples),
                damping_time=scene.options.wall_damping_time,
                elasticity=scene.options.elasticity,
                groups=scene.groups,
                anus=scene.pose.position,
                inwards=scene.pose.frame[:, 2],
                starts=np.array(starts) if starts else np.full(len(tables.count) // len(scene.radii), scene.pose.arc),
                own_stiffness=scene.own("stiffness"),
                own_friction=scene.own("friction"),
                threaded=scene.device.is_shaft,
            )
        if scene.device.has_treads:
            self._treads_every = max(1, round(TREAD_INTERVAL / model.opt.timestep))
            self._surface, self._xmat = batch.expand("geom_surfacevel"), batch.bind("geom_xmat")
        self._nose = self._wall.radius[-1]
        self._bends: Float[np.ndarray, "worlds places"] | None = None
        self._tread_power = np.zeros(worlds)
        self.gas: DeviceGas | None = None
        """What fills the colon, where it is filled."""
        self.healthy: Bool[np.ndarray, " worlds"] = np.ones(worlds, bool)
        options = scene.options
        self.reset(
            np.arange(worlds),
            np.zeros(worlds, int),
            friction=np.full(worlds, float(options.friction)),
            wall_stiffness=np.full(worlds, float(options.wall_stiffness)),
        )

    def reset(
        self,
        worlds: Int[np.ndarray, " reset"],
        colons: Int[np.ndarray, " reset"],
        *,
        friction: Float[np.ndarray, " reset"],
        wall_stiffness: Float[np.ndarray, " reset"],
    ) -> None:
        """Put the devices of some worlds to the anus of the colons of those numbers."""
        self.healthy[worlds], self._bends = True, None
        self._wall.case[worlds] = colons
        self._wall.set_contact(worlds, friction, wall_stiffness)
        self._batch.reset(np.sort(worlds))
        self._wall.begin(worlds)

    def fill(self, gas: DeviceGas) -> None:
        """Let gas hold the colon of the only world."""
        self.gas = gas
        self._yield_to_gas()

    def step(self, commands: Float[np.ndarray, "worlds channels"], count: int) -> Bool[np.ndarray, " worlds"]:
        """Advance by `count` time steps; False for worlds that are lost, which stand still at their start from then.

        A world with commands that are not finite is lost: MuJoCo takes them for none.
        """
        sound = np.asarray(np.isfinite(commands).all(axis=1))
        self._lose(self.healthy & ~sound)
        commands = np.where(sound[:, None], commands, 0.0)
        device, self._bends = self.scene.device, None
        if self.gas and self.gas.advance(float(self._arc()[0]), count * self.model.opt.timestep):
            self._yield_to_gas()
        for number in range(count):
            if number == 0 or (device.has_treads and number % self._treads_every == 0):
                self._command(commands)
            self._wall.place(np.flatnonzero(self.healthy))
            self._batch.step(None if self.healthy.all() else np.flatnonzero(self.healthy))
            self._catch_divergence()
        return self.healthy.copy()

    def set_contact(self, friction: float, wall_stiffness: float) -> None:
        """Give all worlds' contacts that friction [1] and stiffness [N/m] from now on."""
        one = np.ones(self.worlds)
        self._wall.set_contact(np.arange(self.worlds), friction * one, wall_stiffness * one)

    def velocities(self) -> tuple[Float[np.ndarray, "worlds dofs"], Float[np.ndarray, "worlds activations"]]:
        """Generalised velocities [m/s, rad/s], and states of actuators."""
        return self._qvel.copy(), self._act.copy()

    def read(self) -> DeviceReadings:
        """What every device can be told by, at the end of the last step."""
        arcs = self._arc()
        tip = self._site_xpos[:, self._tip].copy()
        return DeviceReadings(
            time=self._time.reshape(-1).copy(),
            tip=tip,
            tip_frame=self._frame(),
            tip_arc=arcs,
            ahead=look_ahead(np, self._tables, self._wall.case * len(self.scene.radii), tip, arcs, self.displacement),
            wall_force=self.body_forces().max(axis=1),
            deepest=self._wall.depth.max(axis=1),
        )

    def body_forces(self) -> Float[np.ndarray, "worlds bodies"]:
        """Resultant normal force of the wall on each body that meets it [N]."""
        return np.linalg.norm(np.einsum("wsi,sb->wbi", self._wall.forces(), self.scene.members), axis=2)

    def loads(self) -> Float[np.ndarray, "worlds spheres"]:
        """Normal force of the wall on each sphere in the last step, where the device is told what the wall does [N]."""
        return self._wall.felt()[0]

    def tendons(self) -> Float[np.ndarray, "worlds tendons"]:
        """Lengths of the scene's tendons at the beginning of the last step [m]."""
        return self._batch.bind("ten_length").copy()

    def mocap(self) -> tuple[Float[np.ndarray, "blocks 3"], Float[np.ndarray, "blocks 4"]]:
        """Where the blocks of pieces of the only world's colon are [m], and how they are turned, as quaternions."""
        if not len(self.scene.blocks.arcs):
            return np.zeros((0, 3)), np.zeros((0, 4))
        return self._batch.bind("mocap_pos")[0].copy(), self._batch.bind("mocap_quat")[0].copy()

    def body_arcs(self) -> Float[np.ndarray, "worlds bodies"]:
        """Mean arc length of each body's spheres [m]."""
        return self._wall.arcs @ (self.scene.members / self.scene.members.sum(axis=0))

    def power(self) -> Float[np.ndarray, " worlds"]:
        """What the actuators that drive put in, and what turns treads [W]; what holds back counts for nothing."""
        return np.maximum(self._force * self._actuator_speed, 0.0).sum(axis=1) + self._tread_power

    def readings(self) -> dict[str, Float[np.ndarray, " worlds"]]:
        """The device's own quantities, by name."""
        return self.scene.device.read(np, self.model, self.scene.handles, self._state())

    @property
    def displacement(self) -> Float[np.ndarray, "worlds nodes 7"] | None:
        """Displacements of the colons' axes [m]; None where they are fixed."""
        return self._wall.displacement

    def spheres(self) -> Float[np.ndarray, "worlds spheres 3"]:
        """Places of the device's spheres, the last at its nose [m]."""
        return self._xpos[:, self._wall.spheres].copy()

    def positions(self) -> tuple[Float[np.ndarray, "worlds positions"], Float[np.ndarray, "worlds actuators"]]:
        """Generalised positions [m, rad], and the controls that led there."""
        return self._qpos.copy(), self._ctrl.copy()

    def world_data(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one world as MuJoCo's own values, to draw or to check."""
        return self._batch.get_model(world), self._batch.get_data(world)

    def _yield_to_gas(self) -> None:
        if self.gas:
            friction, stiffness = np.full(1, float(self.scene.options.friction)), np.full(1, self.gas.place())
            self._wall.set_contact(np.zeros(1, int), friction, stiffness)

    def _command(self, commands: Float[np.ndarray, "worlds channels"]) -> None:
        """Set the device's actuators, and let its treads run."""
        device, handles, state = self.scene.device, self.scene.handles, self._state()
        self._ctrl[:] = device.control(np, self.model, handles, state, commands)
        if device.has_treads:
            treads = device.treads(np, self.model, handles, state, commands)
            self._surface[:, self._wall.spheres, :3] = treads.speed
            frames = self._xmat[:, self._wall.spheres].reshape(*treads.speed.shape, 3)
            self._wall.run_treads(np.einsum("wsij,wsj->wsi", frames, treads.speed))
            self._wall.set_grip(treads.grip)
            self._tread_power = np.asarray(treads.power, float)

    def _state(self) -> State:
        # Python's own arrays: a device must not write into what MuJoCo steps.
        arcs, colons = self._arc(), self._wall.case * len(self.scene.radii)
        if self._bends is None:  # once a control interval
            self._bends = bends_behind(np, self._tables, colons, arcs, self.displacement)
        state = State(
            self._qpos.copy(),
            self._qvel.copy(),
            self._act.copy(),
            self._frame(),
            arcs,
            self._force.copy(),
            bends=self._bends,
        )
        if not self.scene.device.has_treads:
            return state
        pressed, on_wall = self._wall.felt()
        return state._replace(pressed=pressed, rubbed=-on_wall, friction=self._wall.friction)

    def _frame(self) -> Float[np.ndarray, "worlds 3 3"]:
        return self._site_xmat[:, self._tip].reshape(-1, 3, 3).copy()

    def _arc(self) -> Float[np.ndarray, " worlds"]:
        return self._wall.arcs[:, -1] + self._nose

    def _catch_divergence(self) -> None:
        state = np.abs(self._qvel).max(axis=1)
        sound = (state < SPEED_LIMIT) & np.isfinite(self._qpos).all(axis=1)
        sound &= ~self._batch.warning[:, FATAL_WARNINGS, 1].any(axis=1)
        self._lose(self.healthy & ~sound)

    def _lose(self, lost: Bool[np.ndarray, " worlds"]) -> None:
        """Take worlds out until they are reset."""
        if not lost.any():
            return
        self.healthy &= ~lost
        self._batch.reset(np.flatnonzero(lost))
        self._wall.begin(np.flatnonzero(lost))


def look_ahead(xp: Any, tables: Tables, colons: Any, tip: Any, arcs: Any, displacement: Any = None) -> Any:
    """Unit vectors (worlds, 3) from the tip to the lumen's axis `LOOK_AHEAD` further on, at least to the anus.

    The axis is displaced where colons move (worlds, nodes, 3).
    """
    further = xp.maximum(arcs + LOOK_AHEAD, 0.0)[:, None]
    target = axis_at(xp, pick(tables, colons), displacement, further)[:, 0]
    away = target - tip
    return away / xp.maximum(xp.sqrt((away**2).sum(axis=-1, keepdims=True)), 1e-6)


def bends_behind(xp: Any, tables: Tables, colons: Any, arcs: Any, displacement: Any = None) -> Any:
    """Angles (worlds, `BENDS`) that the lumen's axis turns through from the anus to places up to arc lengths [rad].

    Arguments are those of `look_ahead`.
    """
    places = xp.maximum(arcs, 1e-3)[:, None] * np.linspace(0.0, 1.0, BENDS)
    edges = xp.diff(axis_at(xp, pick(tables, colons), displacement, places), axis=1)
    before, after = edges[:, :-1], edges[:, 1:]
    across = xp.sqrt((xp.cross(before, after) ** 2).sum(axis=-1))
    turned = xp.arctan2(across, (before * after).sum(axis=-1))
    return xp.concatenate([xp.zeros((len(arcs), 1)), xp.cumsum(turned, axis=1), turned.sum(axis=1)[:, None]], axis=1)
