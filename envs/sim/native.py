"""MuJoCo on the CPU, one scene: hand and wires in, what the scope does out. Divergence is detected, never hidden."""

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.sim.at_origin import without_pieces
from haustra.envs.sim.capabilities import require_supported
from haustra.envs.sim.coils import coil_samples
from haustra.envs.sim.energy import Energies, EnergyMeter
from haustra.envs.sim.gas import RunGas, run_gas
from haustra.envs.sim.link_places import link_arcs, middle_spheres
from haustra.envs.sim.log import log_to_stderr_only
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.envs.sim.physics.hand import hand_force
from haustra.envs.sim.physics.lock import lock_activation
from haustra.envs.sim.physics.wires import sheath_angle
from haustra.envs.sim.state import SPEED_LIMIT, Controls, Readings
from haustra.envs.sim.water_weight import WaterWeight
from haustra.envs.sim.wheels import Wheels
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.cable import PULL_OUT_LIMIT
from haustra.models.devices.scope.wires import WIRE_NAMES, arriving_pulls
from haustra.models.scene import Scene
from haustra.models.wall.elasticity import LINEAR
from haustra.models.wall.lumen_table import LumenTable, lumen_table, put_distended, stack
from haustra.models.wall.moving_planes import MovedLumen, MovingPlaneWall
from haustra.models.wall.piece_wall import Blocks, PieceWall
from haustra.models.wall.planes import PlaneWall, add_planes
from haustra.models.wall.segment_law import SegmentLaw
from haustra.models.wall.signed_distance import LumenDistance
from haustra.models.wall.table_wall import TableLook, TableWall

FATAL_WARNINGS = [
    int(kind)
    for kind in (
        mujoco.mjtWarning.mjWARN_BADQPOS,
        mujoco.mjtWarning.mjWARN_BADQVEL,
        mujoco.mjtWarning.mjWARN_BADQACC,
        mujoco.mjtWarning.mjWARN_CONTACTFULL,
        mujoco.mjtWarning.mjWARN_CNSTRFULL,
        mujoco.mjtWarning.mjWARN_INERTIA,
    )
]
"""Numbers of MuJoCo's warnings after which a state is not sound."""
_ONLY = np.zeros(1, int)
LEAST_CHANGE = 1e-3
"""The wall is moved when the share of its width changed by this [1]: 0.02 mm of its radius; a tolerance."""


class NativeEngine:
    """One scene on MuJoCo's CPU engine.

    In a wall of pieces that is fixed in space every step is a function of the compiled scene and of `data.ctrl` alone:
    `haustra.models.wall.piece_wall.step_once` repeats a run from the saved scene and its controls to the bit, and
    `mj_step` nearly. Steered by wheels, controls change at every step.
    """

    name = "native"
    """Name in scores."""
    added: Sequence[float] = ()
    """When shaft was added [s]: never."""

    def __init__(self, scene: Scene, *, table: LumenTable | None = None) -> None:
        """Compile the scene and lay the scope straight, its tip at the start depth.

        Args:
            scene: what is modelled.
            table: of the colon for this scope, when it is there already; wall laws 'table' and 'pieces'.

        Raises:
            UnsupportedSceneError: when the scene has what this backend cannot honour.
        """
        require_supported(scene, "native")
        log_to_stderr_only()
        self.scene = scene
        self.table = table
        self.model = self._compiled()
        self.data = mujoco.MjData(self.model)
        cable = scene.cable
        model = self.model
        self._push = model.actuator("scope/push").id
        self._roll = model.actuator("scope/roll").id
        self._hand_limits = model.actuator_forcerange[[self._push, self._roll], 1]
        self._pulls = [model.actuator(f"scope/pull_{name}").id for name in WIRE_NAMES]
        self._locks = np.array([[model.actuator(name).id for name in pair] for pair in cable.locks])
        self._tip = model.site("scope/tip").id
        self._link_of_body = np.full(model.nbody, -1)
        self._links = [model.body(name).id for name in cable.links]
        self._middle = middle_spheres(
            np.array([cable.links.index(sample.body) for sample in scene.samples]), len(cable.links)
        )
        self._link_of_body[self._links] = np.arange(len(cable.links))
        steerable = [index for index, cell in enumerate(cable.cells) if cell.steerable]
        self._bend_up = [model.joint(f"scope/bend_y_{index:03d}").qposadr[0] for index in steerable]
        self._bend_left = [model.joint(f"scope/bend_x_{index:03d}").qposadr[0] for index in steerable]
        shaft = [index for index, cell in enumerate(cable.cells) if not cell.steerable]
        self._sheath = np.array(
            [[model.joint(f"scope/bend_{side}_{i:03d}").qposadr[0] for i in shaft] for side in "xy"]
        )
        self._hand = self._arriving = np.zeros(len(WIRE_NAMES))
        self._wheels: Wheels | None = None
        self._behind = cable.length - cable.joint_positions
        self._start = scene.options.start_depth
        self._lock_outside(self._start)
        self._wall = self._placed_wall()
        moves = scene.options.mesentery and self.table
        own = np.zeros(3), np.eye(3)
        self._moved = CurrentColon(scene.colon, stack([moves.tables]), *own) if moves else None
        self._law = self._segment_law()
        stiffness = self._law.by_geom if self._law else scene.options.wall_stiffness
        self.gas: RunGas | None = None
        """What fills the colon, where the scene has gas."""
        if self.table is not None and scene.options.gas is not None:
            assert isinstance(self._wall, TableWall)
            self._stiffness = stiffness = np.zeros(model.ngeom)
            self._rest, self._placed = self._wall.table.copy(), np.ones(len(self._wall.table))
            own = {"stations": len(self._rest), "device_radius": self.table.device_radius}
            self.gas = run_gas(scene.colon, scene.options, **own)
            hung = stack([self.table.tables]).mesentery
            self._weight = hung and WaterWeight([scene.colon], hung)
        self._energies = EnergyMeter(model, wall_stiffness=stiffness)
        self._yield_to_gas(anew=True)
        mujoco.mj_forward(self.model, self.data)
        self.read().checked()  # the shapes stay

    def step(self, inputs: Controls, count: int) -> bool:
        """Advance by `count` time steps; False when the simulation has diverged.

        Raises:
            InvalidDesignError: when wheels steer wires that do not stretch.
            InvalidOptionError: when an input is not a finite number; MuJoCo would take all controls for zero. Also
                when the shaft is to be pulled out faster than `PULL_OUT_LIMIT`.
        """
        _require_possible(inputs)
        control = self.data.ctrl
        control[self._push] = inputs.push_rate
        control[self._roll] = inputs.roll_rate
        self._lock_outside(self.insertion)
        if self.gas and self.gas.advance(float(self._wall.arcs[-1]), count * self.model.opt.timestep):
            self._yield_to_gas()
        if inputs.wheels is None:
            control[self._pulls] = self._arrive(inputs.pulls)
            self._advance(count)
            return self.healthy()
        self._wheels = self._wheels or Wheels(self.model, self.scene.cable, self.scene.design.wires)
        for _ in range(count):
            control[self._pulls] = self._arrive(self._wheels.pulls(self.data, inputs.wheels))
            self._advance(1)
        return self.healthy()

    def _yield_to_gas(self, *, anew: bool = False) -> None:
        """Put the wall where gas and water hold it, as stiff and as heavy as they make it."""
        if self.gas:
            assert isinstance(self._wall, TableWall) and self.table
            widths = self.gas.widths
            if anew or np.abs(widths - self._placed).max() > LEAST_CHANGE:
                put_distended(self._wall.table, self._rest, widths, device_radius=self.table.device_radius)
                self._placed = widths
            if self._weight:
                self._wall.weigh(self._weight.loads(_ONLY, self.gas.water[None])[0])
            self._wall.lose_pressure(self.gas.pressure_lost)
            self._wall.set_stiffness(self.gas.stiffness)
            self._stiffness[:] = self.gas.stiffness

    def put(self, qpos: Float[np.ndarray, " positions"]) -> None:
        """Lay the scope as those generalised positions say, at rest; the hand goes along [m, rad].

        Tangent planes are looked for where each part lies when the scope follows the centreline.
        """
        data = self.data
        data.qpos[:], data.qvel[:], data.act[:2] = qpos, 0.0, qpos[:2]
        self._lock_outside(self.insertion)
        self._wall.begin(self._straight_arcs + self.insertion - self._start)
        mujoco.mj_forward(self.model, data)

    def resume(self, other: "NativeEngine") -> None:
        """Go on with the hands of a backend of the same scope, whose positions and speeds this one was given."""
        self._hand, self._arriving = other._hand, other._arriving
        self._lock_outside(self.insertion)
        # This scope may have more shaft; straight, both lie with their tips in the same place.
        self._wall.begin(np.interp(self._straight_arcs, other._straight_arcs, other._wall.arcs))
        if isinstance(self._wall, TableWall) and isinstance(other._wall, TableWall):
            self._wall.resume(other._wall)
        if isinstance(self._wall, PieceWall) and isinstance(other._wall, PieceWall):
            self._wall.resume(other._wall)
        if isinstance(self._wall, MovingPlaneWall) and isinstance(other._wall, MovingPlaneWall):
            self._wall.resume(other._wall)
        self.gas = other.gas
        self._yield_to_gas(anew=True)
        mujoco.mj_forward(self.model, self.data)

    def _advance(self, count: int) -> None:
        """Advance by `count` steps; the wall follows before each."""
        for _ in range(count):
            if not np.isfinite(self.data.qpos).all():
                return
            self._wall.update(self.data)
            if self._law:
                self._law.follow(self._wall.arcs)
            self._wall.step(self.data)

    def _compiled(self) -> mujoco.MjModel:
        """The scene's model; by a table, each sphere has a plane to be placed, of which a saved scene knows nothing.

        Pieces that nothing touches are in the saved scene only.
        """
        scene, options = self.scene, self.scene.options
        if options.wall_law != "planes" or options.mesentery:
            self.table = self.table or lumen_table(
                scene.colon, device_radius=scene.cable.radius, with_mesentery=options.mesentery, abdomen=options.abdomen
            )
        if options.wall_law != "table":
            return scene.compile()
        spec = without_pieces(scene)
        add_planes(spec, spec.compile(), scene.samples, options.contact, timestep=options.timestep, planes=1)
        return spec.compile()

    def _placed_wall(self) -> TableWall | PlaneWall | PieceWall:
        """The wall of a scope that lies straight at the anus."""
        mujoco.mj_kinematics(self.model, self.data)
        scene, contact = self.scene, self.scene.options.contact
        spheres = [self.model.geom(f"wall/sphere_{number:04d}").id for number in range(len(scene.samples))]
        self._coils = np.array(spheres)[coil_samples(self.model, scene.samples)]
        self._straight_arcs = (self.data.geom_xpos[spheres] - scene.entry) @ scene.entry_direction
        if self.table is None:
            return PlaneWall(self.model, LumenDistance(scene.colon), arcs=self._straight_arcs)
        if scene.options.wall_law == "table":
            return TableWall(self.model, self.table, contact, arcs=self._straight_arcs)
        look = TableLook(self.model, np.array(spheres), stack([self.table.tables]), threaded=True)
        if scene.options.wall_law == "planes":
            lumen = MovedLumen(scene.colon, look)
            return MovingPlaneWall(self.model, lumen, look, contact, arcs=self._straight_arcs, threaded=True)
        wall = PieceWall(self.model, contact, look, blocks=scene.blocks, threaded=True)
        wall.begin(self._straight_arcs)
        return wall

    def _segment_law(self) -> SegmentLaw | None:
        """What pushes back by segment, if the scene asks for it."""
        options = self.scene.options
        if not isinstance(self._wall, PlaneWall) or not options.segment_stiffness:
            return None
        stiffness = dict(options.segment_stiffness)
        return SegmentLaw(self.model, self.scene.colon, stiffness, options.contact, self._wall)

    @property
    def insertion(self) -> float:
        """Length of scope past the anus [m]."""
        return self._start + float(self.data.qpos[0])

    @property
    def qpos(self) -> Float[np.ndarray, " positions"]:
        """Generalised positions [m, rad]."""
        return self.data.qpos.copy()

    @property
    def ctrl(self) -> Float[np.ndarray, " actuators"]:
        """Controls of the last step [m/s, rad/s, N, 1]."""
        return self.data.ctrl.copy()

    def healthy(self) -> bool:
        """Whether the state is finite, of plausible speed, and free of the backend's own fatal warnings."""
        if self.data.warning.number[FATAL_WARNINGS].any():
            return False
        speed = np.abs(self.data.qvel).max()
        return bool(np.isfinite(speed) and speed < SPEED_LIMIT and np.isfinite(self.data.qpos).all())

    def read(self) -> Readings:
        """What can be read off at the end of the last step."""
        data = self.data
        frame = data.site_xmat[self._tip].reshape(3, 3)
        forces, normal = self._link_forces()
        # What MuJoCo leaves is that of the beginning of its last step.
        hand = hand_force(np, data.act[:2], data.qpos[:2], data.qvel[:2], self._hand_limits)
        return Readings(
            time=data.time,
            insertion=self.insertion,
            roll=float(data.qpos[1]),
            hand_lead=float(data.act[0] - data.qpos[0]),
            tip=data.site_xpos[self._tip].copy(),
            tip_frame=frame.copy(),
            bend=np.array([data.qpos[self._bend_up].sum(), -data.qpos[self._bend_left].sum()]),
            push_force=float(hand[0]),
            torque=float(hand[1]),
            pulls=self._hand.copy(),
            link_forces=forces,
            link_arcs=link_arcs(self._wall.arcs, self._middle),
            contacts=int((normal > 0).sum()),
            way=self._moved.way(self._displacement) if self._moved else None,
            energies=self._energies_now(),
            wall_force_sum=float(normal.sum()),
            coils=data.geom_xpos[self._coils].copy(),
            displacement=self._displacement.copy() if self._moved else None,
        )

    def _energies_now(self) -> Energies:
        energies = self._energies.read(self.data)
        if isinstance(self._wall, TableWall) and self.scene.options.elasticity != LINEAR:
            return replace(energies, wall=self._wall.energy())
        return energies

    def colon(self) -> Colon:
        """The colon as it lies now."""
        colon = self._moved.colon(self._displacement) if self._moved else self.scene.colon
        return self.gas.colon(colon) if self.gas else colon

    @property
    def _displacement(self) -> Float[np.ndarray, "nodes 7"]:
        moved = self._wall.displacement
        assert moved is not None
        return moved

    def mocap(self, blocks: Blocks) -> tuple[Float[np.ndarray, "blocks 3"], Float[np.ndarray, "blocks 4"]]:
        """Where these blocks of the wall are [m], and how they are turned, as quaternions; none in a fixed colon."""
        if isinstance(self._wall, PieceWall):
            return self.data.mocap_pos.copy(), self.data.mocap_quat.copy()
        if self._moved and len(blocks.arcs):
            return self._moved.poses(self._displacement, blocks)
        return np.zeros((0, 3)), np.zeros((0, 4))

    def shape(self) -> Float[np.ndarray, "nodes 3"]:
        """Points along the scope's axis, from the handle end of the modelled part to the tip [m]."""
        return np.vstack([self.data.xpos[self._links], self.data.site_xpos[self._tip]])

    def _arrive(self, pulls: Float[np.ndarray, "4"]) -> Float[np.ndarray, "4"]:
        """What of the hand's pulls gets through the bent shaft to the bending section [N]."""
        self._hand = pulls
        wires, angle = self.scene.design.wires, sheath_angle(np, *self.data.qpos[self._sheath])
        losses = {"friction": wires.friction, "hysteresis": wires.hysteresis}
        self._arriving = arriving_pulls(np, pulls, self._arriving, **losses, sheath_angle=angle)
        return self._arriving

    def _lock_outside(self, insertion: float) -> None:
        """Hold joints straight that are outside the patient, and free them smoothly as they pass the anus."""
        self.data.ctrl[self._locks] = lock_activation(np, np.float64(insertion), self._behind)[:, None]

    def _link_forces(self) -> tuple[Float[np.ndarray, " links"], Float[np.ndarray, " contacts"]]:
        """Resultant on each link, and the normal force of each contact [N]."""
        data = self.data
        contact, count = data.contact, len(self.scene.cable.links)
        rows = contact.efc_address
        active = rows >= 0
        normal = data.efc_force[rows[active]]
        links = self._link_of_body[self.model.geom_bodyid[contact.geom[active]]].max(axis=1)
        forces = contact.frame[active, :3] * normal[:, None]
        total = [np.bincount(links, weights=forces[:, axis], minlength=count) for axis in range(3)]
        return np.linalg.norm(total, axis=0), normal


def _require_possible(inputs: Controls) -> None:
    for name, value in inputs.checked()._asdict().items():
        if value is not None and not np.isfinite(value).all():
            raise InvalidOptionError(f"The input {name} is {value}: give finite numbers.")
    if inputs.push_rate < -PULL_OUT_LIMIT:
        raise InvalidOptionError(
            f"The input push_rate is {inputs.push_rate} m/s: pull the scope out at {PULL_OUT_LIMIT:g} m/s at most."
        )
