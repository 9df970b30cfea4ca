"""One scope in one colon in linear time, with the interface of the native backend.

The scope meets the colon's table of radii (`haustra.models.wall.lumen_table`), so no wall needs to be built. Places are
turned from those of the colon's entry to the scene's; what is drawn is placed by MuJoCo.
"""

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.sim.energy import Energies, EnergyMeter
from haustra.envs.sim.gas import RunGas
from haustra.envs.sim.linear.backend import LinearBackend, Row
from haustra.envs.sim.linear.compile import Driver
from haustra.envs.sim.linear.layout import WORLD
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.envs.sim.physics.lock import lock_activation
from haustra.envs.sim.state import Controls, Readings
from haustra.envs.sim.wheels import pulls_at, wire_arms
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.scene import Scene, entry_of
from haustra.models.wall import moving_colon
from haustra.models.wall.elasticity import depth_under, stored_energy
from haustra.models.wall.lumen_table import TableAccuracy, Tables, lumen_table, stack
from haustra.models.wall.moving_colon import POSE
from haustra.models.wall.piece_wall import Blocks


class LinearSingle:
    """A scene of wall law 'table', stepped in linear time in double precision."""

    name = "linear"
    """Name in scores."""
    added: Sequence[float] = ()
    """When shaft was added [s]: never."""
    table_error: TableAccuracy
    """Accuracy of the colon's table against its surface."""

    def __init__(self, scene: Scene, *, driver: Driver | None = None, tables: Tables | None = None, **own: Any) -> None:
        """Tabulate the colon and lay the scope straight, its tip at the start depth.

        Args:
            scene: the scene.
            driver: who drives within the program; hands outside it when None.
            tables: the colon's, seen from its entry and stacked, when they are there already.
            own: more of `LinearBackend`.

        Raises:
            UnsupportedSceneError: when the scene has what this backend cannot honour.
        """
        self.scene = scene
        self.model = scene.compile()
        self.data = mujoco.MjData(self.model)
        if tables is None:
            table = lumen_table(
                scene.colon,
                device_radius=scene.cable.radius,
                with_mesentery=scene.options.mesentery,
                abdomen=scene.options.abdomen,
            )
            self.table_error = table.error
            tables = stack([table.seen_from(*entry_of(scene.colon))])
        self._origin, self._axes = entry_of(scene.colon)
        self.many = LinearBackend(scene, tables, worlds=1, real=np.float64, driver=driver, **own)
        moves = scene.options.mesentery
        self._moved = CurrentColon(scene.colon, tables, self._origin, self._axes) if moves else None
        self._energies = EnergyMeter(self.model, wall_stiffness=scene.options.wall_stiffness)
        self._links = [self.model.body(name).id for name in scene.cable.links]
        self._tip = self.model.site("scope/tip").id
        names = ("scope/push", "scope/roll", *(f"scope/pull_{name}" for name in WIRE_NAMES))
        self._controls = [self.model.actuator(name).id for name in names]
        self._locks = np.array([[self.model.actuator(name).id for name in pair] for pair in scene.cable.locks])
        self.hand, self._arms = Controls(0.0, 0.0), wire_arms(self.model)
        self._begun = scene.options.start_depth
        gas = self.many.gas
        self.gas = gas and RunGas(scene.colon, gas, stations=int(tables.count[0]))
        """What fills the colon, where the scene has gas."""

    def step(self, inputs: Controls, count: int) -> bool:
        """Advance by `count` time steps; False when the simulation has diverged.

        Raises:
            InvalidDesignError: when wheels steer wires that do not stretch.
        """
        self.hand, self._begun = inputs.checked(), self.insertion
        hands = Controls(*(None if part is None else np.asarray(part)[None] for part in inputs))
        sound = bool(self.many.step(hands, count)[0])
        self.place()
        return sound

    def healthy(self) -> bool:
        """Whether the state is finite and of plausible speed."""
        return bool(self.many.alive[0])

    @property
    def insertion(self) -> float:
        """Length of scope past the anus [m]."""
        return self.scene.options.start_depth + float(self.qpos[0])

    def read(self) -> Readings:
        """What can be read off at the end of the last step."""
        now = self.rows()
        seen, qpos = self.readings(now), self.many.joints(now.state)
        normals, moved = self.many.normals(now.state)[0], self.displacements(now)
        return Readings(
            time=float(seen.time[0]),
            insertion=float(seen.insertion[0]),
            roll=float(seen.roll[0]),
            hand_lead=float(seen.hand_lead[0]),
            tip=seen.tip[0],
            tip_frame=seen.tip_frame[0],
            bend=seen.bend[0],
            push_force=float(seen.push_force[0]),
            torque=float(seen.torque[0]),
            pulls=self._pulls(qpos[0]),
            link_forces=seen.link_forces[0],
            link_arcs=seen.link_arcs[0],
            contacts=int((normals > 0).sum()),
            wall_force_sum=float(normals.sum()),
            way=self._moved.way(moved[0]) if self._moved else None,
            coils=seen.coils[0],
            displacement=seen.displacement[0] if self._moved else None,
            energies=Energies(
                bending=float(self._energies.bending(qpos)[0]),
                twist=float(self._energies.twist(qpos)[0]),
                wall=float(self.wall_energy(now)[0]),
            ),
        )

    def _pulls(self, qpos: np.ndarray) -> Float[np.ndarray, "4"]:
        """Pull of each wire at the handle: as asked, or by what wheels and bends stretch it [N]."""
        if self.hand.wheels is None:
            return np.array(self.hand.pulls)
        return pulls_at(self.scene.design.wires, np.asarray(self.hand.wheels), self._arms @ qpos)

    def keep(self) -> tuple[Any, float]:
        """All that the scope and what it is in are, to go back to."""
        return self.many.keep(), self._begun

    def put_back(self, kept: tuple[Any, float], hand: Controls) -> None:
        """Go back to where the scope was, under the hand of then."""
        (many, self._begun), self.hand = kept, hand
        self.many.put_back(many)
        self.place()

    # Rows of several times at once.

    def rows(self) -> Row:
        """The one of now."""
        return Row(*(part[None] for part in self.many.row()))

    def readings(self, rows: Row) -> Readings:
        """What was read off, in the scene's coordinates."""
        seen = self.many.readings(rows.state, rows.seen)
        tip, frame = seen.tip @ self._axes.T + self._origin, np.einsum("ij,rjk->rik", self._axes, seen.tip_frame)
        moved = moving_colon.poses_seen_from(self.displacements(rows), self._axes.T) if self._moved else None
        coils = seen.coils @ self._axes.T + self._origin
        return seen._replace(tip=tip, tip_frame=frame, coils=coils, displacement=moved)

    def displacements(self, rows: Row) -> Float[np.ndarray, "rows nodes 7"]:
        """Poses of the colon's axis, seen from its entry; none where it is fixed."""
        return self.many.axes(rows.state)[..., :POSE] if self._moved else np.zeros((len(rows.state), 0, POSE))

    def wall_energy(self, rows: Row) -> Float[np.ndarray, " rows"]:
        """E_b, stored in pressing the wall [J]."""
        normals, stiffness = self.many.normals(rows.state), rows.worlds[:, WORLD.index("stiffness"), None]
        law = self.scene.options.elasticity
        return stored_energy(law, depth_under(law, normals, stiffness), stiffness).sum(axis=1)

    def bending_energy(self, rows: Row) -> Float[np.ndarray, " rows"]:
        """E_c, stored in bending the scope [J]."""
        return self._energies.bending(self.many.joints(rows.state))

    def colon_moved(self, rows: Row) -> Float[np.ndarray, " rows"]:
        """Farthest that a node of the colon's axis is from where it was at rest [m]."""
        return np.sqrt((self.displacements(rows)[..., :3] ** 2).sum(-1).max(-1, initial=0.0))

    def controls(self, rows: Row, begun: Float[np.ndarray, " rows"]) -> Float[np.ndarray, "rows actuators"]:
        """Controls that led there, as the native backend's [m/s, rad/s, N, 1].

        Args:
            rows: some.
            begun: length past the anus when each control step began [m].
        """
        found = np.zeros((len(rows.state), self.model.nu))
        rates = [rows.worlds[:, WORLD.index(name)] for name in ("push_rate", "roll_rate")]
        found[:, self._controls] = np.column_stack([*rates, self.many.arrived(rows.state)])
        behind = self.scene.cable.length - self.scene.cable.joint_positions
        held = lock_activation(np, begun[:, None], behind)
        found[:, self._locks] = held[..., None]
        return found

    def poses(
        self, rows: Row, blocks: Blocks
    ) -> tuple[Float[np.ndarray, "rows blocks 3"], Float[np.ndarray, "rows blocks 4"]]:
        """Where these blocks of the wall are [m], and how they are turned, as quaternions; none in a fixed colon."""
        if self._moved is None:
            return np.zeros((len(rows.state), 0, 3)), np.zeros((len(rows.state), 0, 4))
        return self._moved.many_poses(self.displacements(rows), blocks)

    # As one instant.

    @property
    def qpos(self) -> Float[np.ndarray, " positions"]:
        """Generalised positions [m, rad]."""
        return self.many.positions()[0]

    @property
    def ctrl(self) -> Float[np.ndarray, " actuators"]:
        """Controls of the last step, as the native backend's [m/s, rad/s, N, 1]."""
        return self.controls(self.rows(), np.array([self._begun]))[0]

    def shape(self) -> Float[np.ndarray, "nodes 3"]:
        """Points along the scope's axis, from the handle end of the modelled part to the tip [m]."""
        self.place()
        return np.vstack([self.data.xpos[self._links], self.data.site_xpos[self._tip]])

    def colon(self) -> Colon:
        """The colon as it lies now."""
        colon = self._moved.colon(self.displacements(self.rows())[0]) if self._moved else self.scene.colon
        return self.gas.colon(colon) if self.gas else colon

    def mocap(self, blocks: Blocks) -> tuple[Float[np.ndarray, "blocks 3"], Float[np.ndarray, "blocks 4"]]:
        """Where these blocks of the wall are [m], and how they are turned, as quaternions; none in a fixed colon."""
        places, turns = self.poses(self.rows(), blocks)
        return places[0], turns[0]

    def place(self) -> None:
        """Put MuJoCo's scope where this one is."""
        self.data.qpos[:] = self.qpos
        mujoco.mj_kinematics(self.model, self.data)
