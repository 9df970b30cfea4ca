"""One scope in one colon on JAX, with the interface of the native backend.

The scope meets the colon's table of radii (`haustra.models.wall.lumen_table`), so no wall needs to be built. What is
drawn is placed by MuJoCo.
"""

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.sim.device_arrays import on_device
from haustra.envs.sim.energy import Energies, EnergyMeter
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.envs.sim.scope_values import Array, State
from haustra.envs.sim.scope_worlds import JaxScopes
from haustra.envs.sim.state import Controls, Readings
from haustra.errors import UnsupportedSceneError
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.scene import Scene, entry_of
from haustra.models.wall.lumen_table import TableAccuracy, lumen_table, stack
from haustra.models.wall.piece_wall import Blocks


class JaxSingle:
    """A scene of wall law 'table', stepped in JAX."""

    name = "jax"
    """Name in scores."""
    added: Sequence[float] = ()
    """When shaft was added [s]: never."""
    table_error: TableAccuracy
    """Of the colon's table against its surface."""

    def __init__(self, scene: Scene) -> None:
        """Tabulate the colon and lay the scope straight, its tip at the start depth; the backend is compiled here.

        Raises:
            UnsupportedSceneError: when the scene has what this backend cannot honour.
        """
        self.scene = scene
        self.model = scene.compile()
        self.data = mujoco.MjData(self.model)
        field = lumen_table(scene.colon, device_radius=scene.cable.radius, with_mesentery=scene.options.mesentery)
        self.table_error = field.error
        place = entry_of(scene.colon)
        tables = stack([field.seen_from(*place)])
        self._engine = JaxScopes.of(scene)
        own = on_device(tables)
        self._moved = CurrentColon(scene.colon, tables, *place) if scene.options.mesentery else None
        parameters = self._engine.parameters(scene, 1)

        self._shapes: list[tuple[int, ...]] = []
        self._measured: list[str] = []

        def advance(now: State, asked: Float[Array, "6"], count: Any) -> tuple[State, Float[Array, " all"]]:
            hands = Controls(asked[:1], asked[1:2], asked[None, 2:])
            held = self._engine.lock_activation(parameters, now)
            now = self._engine.steps(own, parameters, now, hands, count)
            seen = self._engine.read(parameters, own, now)
            self._measured = [name for name, part in seen._asdict().items() if part is not None]
            own_parts = (held, now.pulls, now.qpos, now.normal, now.healthy)
            parts = (*own_parts, *(getattr(seen, name) for name in self._measured))
            self._shapes = [part.shape[1:] for part in parts]
            return now, jnp.concatenate([part.ravel().astype(jnp.float32) for part in parts])

        # One call and one transfer a control interval: each costs as much as a few time steps.
        self._advance = jax.jit(advance)
        self._worlds = self._engine.begin(parameters, own)
        self._step(np.zeros(6, np.float32), 0)
        self._hand = np.zeros(len(WIRE_NAMES))
        self._energies = EnergyMeter(self.model, wall_stiffness=scene.options.wall_stiffness)
        self._tip = self.model.site("scope/tip").id
        self._links = [self.model.body(name).id for name in scene.cable.links]
        controls = ("scope/push", "scope/roll", *(f"scope/pull_{name}" for name in WIRE_NAMES))
        self._controls = [self.model.actuator(name).id for name in controls]
        self._locks = np.array([[self.model.actuator(name).id for name in pair] for pair in scene.cable.locks])
        self._place()

    def step(self, inputs: Controls, count: int) -> bool:
        """Advance by `count` time steps; False when the simulation has diverged.

        Raises:
            UnsupportedSceneError: when wheels steer.
        """
        if inputs.wheels is not None:
            raise UnsupportedSceneError("The backend 'jax' steers by pulls: use the native backend for wheels.")
        self._hand = inputs.checked().pulls
        asked = np.array([inputs.push_rate, inputs.roll_rate, *inputs.pulls], np.float32)
        self._step(asked, count)
        self.data.ctrl[self._controls] = [*asked[:2], *self._arriving]
        self.data.ctrl[self._locks] = self._held.reshape(-1, 2)
        self._place()
        return self.healthy()

    def _step(self, asked: Float[np.ndarray, "6"], count: int) -> None:
        """Advance JAX's world and read it."""
        self._worlds, flat = self._advance(self._worlds, asked, count)
        ends = np.cumsum([np.prod(shape, dtype=int) for shape in self._shapes])
        parts = np.split(np.asarray(flat, float), ends[:-1])
        parts = [part.reshape(shape) for part, shape in zip(parts, self._shapes, strict=True)]
        self._held, self._arriving, self._qpos, self._normal, healthy = parts[:5]
        self._healthy = bool(healthy)
        self._seen = Readings(**dict(zip(self._measured, parts[5:], strict=True)))

    def healthy(self) -> bool:
        """Whether the state is finite and of plausible speed."""
        return self._healthy

    @property
    def insertion(self) -> float:
        """Length of scope past the anus [m]."""
        return self.scene.options.start_depth + float(self.data.qpos[0])

    def colon(self) -> Colon:
        """The colon as it lies now."""
        return self._moved.colon(np.asarray(self._seen.displacement)) if self._moved else self.scene.colon

    def mocap(self, blocks: Blocks) -> tuple[Float[np.ndarray, "blocks 3"], Float[np.ndarray, "blocks 4"]]:
        """Where these blocks of the wall are [m], and how they are turned, as quaternions; none in a fixed colon."""
        if self._moved is None:
            return np.zeros((0, 3)), np.zeros((0, 4))
        return self._moved.poses(np.asarray(self._seen.displacement), blocks)

    @property
    def qpos(self) -> Float[np.ndarray, " positions"]:
        """Generalised positions [m, rad]."""
        return self.data.qpos.copy()

    @property
    def ctrl(self) -> Float[np.ndarray, " actuators"]:
        """Controls of the last step, as the native backend's [m/s, rad/s, N, 1]."""
        return self.data.ctrl.copy()

    def read(self) -> Readings:
        """What can be read off at the end of the last step."""
        seen, data = self._seen, self.data
        joints = self._energies.read(data)
        return Readings(
            time=float(seen.time),
            insertion=self.insertion,
            roll=float(data.qpos[1]),
            hand_lead=float(seen.hand_lead),
            tip=data.site_xpos[self._tip].copy(),
            tip_frame=data.site_xmat[self._tip].reshape(3, 3).copy(),
            bend=seen.bend,
            push_force=float(seen.push_force),
            torque=float(seen.torque),
            pulls=self._hand.copy(),
            link_forces=seen.link_forces,
            contacts=int((self._normal > 0).sum()),
            wall_force_sum=float(self._normal.sum()),
            way=self._moved.way(np.asarray(self._seen.displacement)) if self._moved else None,
            energies=Energies(
                bending=joints.bending,
                twist=joints.twist,
                wall=float(0.5 * (self._normal**2).sum() / self.scene.options.wall_stiffness),
            ),
        )

    def shape(self) -> Float[np.ndarray, "nodes 3"]:
        """Points along the scope's axis, from the handle end of the modelled part to the tip [m]."""
        return np.vstack([self.data.xpos[self._links], self.data.site_xpos[self._tip]])

    def _place(self) -> None:
        """Put MuJoCo's scope where JAX's is."""
        self.data.qpos[:] = self._qpos
        mujoco.mj_kinematics(self.model, self.data)
