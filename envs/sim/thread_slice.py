"""The worlds of one thread: planes placed, locks set, MuJoCo stepped, divergence caught."""

from threading import Lock

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int
from mujoco.batch import Batch

from haustra.envs.sim.coils import coil_samples
from haustra.envs.sim.conditions import Conditions, Snapshot
from haustra.envs.sim.native import FATAL_WARNINGS, SPEED_LIMIT
from haustra.models.devices.scope.cable import LOCK_STRETCH
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.scene import Scene
from haustra.models.wall.compiled import loops
from haustra.models.wall.law import SLIP_SPEED, normal_force, require_honoured, soft_contact
from haustra.models.wall.lumen_table import Tables
from haustra.models.wall.planes import AWAY
from haustra.models.wall.table_wall import TableWalls

_TURN = Lock()
"""Held by the thread that is between two of MuJoCo's steps. Numpy gives Python's own lock away and takes it back in
every loop over more than 500 numbers; two threads that do so at once wake each other a hundred times a step, which
costs a quarter of their time (`haustra bench cores`)."""


class ThreadSlice:
    """Some worlds of a batch."""

    def __init__(self, scene: Scene, model: mujoco.MjModel, tables: Tables, worlds: int) -> None:
        """Find everything in the model."""
        self._scene, self._model, self._worlds = scene, model, worlds
        self._batch = Batch(model, worlds, nthread=1)
        batch, cable = self._batch, scene.cable
        self._qpos, self._qvel, self._act = (batch.bind(name) for name in ("qpos", "qvel", "act"))
        self._ctrl, self._time = batch.bind("ctrl"), batch.bind("time")
        self._mocap_pos, self._mocap_quat = batch.bind("mocap_pos"), batch.bind("mocap_quat")
        self._geom_xpos, self._force = batch.bind("geom_xpos"), batch.bind("actuator_force")
        self._site_xpos, self._site_xmat = batch.bind("site_xpos"), batch.bind("site_xmat")
        self._friction = batch.expand("pair_friction")
        self._solref, self._solimp = batch.expand("pair_solref"), batch.expand("pair_solimp")
        self._solref_friction, self._margin = batch.expand("pair_solreffriction"), batch.expand("pair_margin")
        self._springs = [batch.expand(name) for name in ("jnt_stiffness", "dof_damping", "dof_armature")]
        self._find(cable)
        self._step_time = scene.options.timestep
        self._damper_time = scene.options.wall_damping_time + self._step_time
        """c + h K over K [s]."""
        self._nominal = [np.array(getattr(model, name)) for name in ("jnt_stiffness", "dof_damping", "dof_armature")]
        self._start_state = batch.state[0].copy()
        self._stiffness = np.full(worlds, float(scene.options.wall_stiffness))
        self.healthy: Bool[np.ndarray, " worlds"] = np.ones(worlds, bool)
        spheres = len(self._spheres)
        self._walls = TableWalls(tables, worlds, spheres, radius=float(self._radius))
        self._surface = np.zeros((0, 0, 0))
        if tables.mesentery is not None:
            self._surface = batch.expand("geom_surfacevel")
        self._ahead = np.full(worlds, self._damper_time)
        self._friction_of = np.full(worlds, float(scene.options.friction))
        self._normal_force = np.zeros((worlds, spheres))
        self._before = np.zeros((worlds, spheres, 3))
        """Where the spheres were before the last step but one [m]."""
        self._points = np.zeros((worlds, spheres, 3))
        self._on_wall, self._damping = np.zeros((worlds, spheres, 3)), np.zeros((worlds, spheres))
        self._seen: dict[str, np.ndarray] | None = None

    def _find(self, cable) -> None:
        model, samples = self._model, self._scene.samples
        count = len(samples)
        first = model.geom("wall/sphere_0000").id
        self._spheres = np.array([model.geom(f"wall/sphere_{i:04d}").id for i in range(count)])
        self._radius = model.geom_size[first, 0]
        self._planes = np.array([model.body_mocapid[model.body(f"wall/plane_{i:04d}_0").id] for i in range(count)])
        self._plane_geoms = np.array([model.geom(f"wall/plane_{i:04d}_0").id for i in range(count)])
        self._pairs = np.array([model.pair(f"wall/plane_{i:04d}_0").id for i in range(count)])
        self._inverse_inertia = model.body_invweight0[model.geom_bodyid[self._spheres], 0]
        links = {name: index for index, name in enumerate(cable.links)}
        self._members = np.zeros((count, len(links)))
        self._members[np.arange(count), [links[sample.body] for sample in samples]] = 1.0
        self._push, self._roll = model.actuator("scope/push").id, model.actuator("scope/roll").id
        self._pulls = np.array([model.actuator(f"scope/pull_{name}").id for name in WIRE_NAMES])
        self._locks = np.array([[model.actuator(name).id for name in pair] for pair in cable.locks])
        self._behind = cable.length - cable.joint_positions
        self._tip = model.site("scope/tip").id
        self._coils = self._spheres[coil_samples(model, samples)]
        joints = [(side, index) for index, cell in enumerate(cable.cells) for side in "xy"]
        steerable = [index for index, cell in enumerate(cable.cells) if cell.steerable]
        self._tip_links = np.array([cable.links.index(f"scope/link_{index:03d}") for index in steerable])
        shaft = [model.joint(f"scope/bend_{side}_{i:03d}").id for side, i in joints if i not in steerable]
        self._shaft_joints = np.array(shaft)
        self._shaft_dofs = model.jnt_dofadr[self._shaft_joints]
        self._bend_up, self._bend_left = (
            np.array([model.joint(f"scope/bend_{side}_{i:03d}").qposadr[0] for i in steerable]) for side in "yx"
        )

    def reset(self, worlds: Int[np.ndarray, " reset"], case: Int[np.ndarray, " reset"], conditions: Conditions) -> None:
        """Begin again in these worlds."""
        self._seen = None
        self._batch.state[worlds] = self._start_state
        self._batch.warning[worlds] = 0
        self.healthy[worlds] = True
        self._stiffness[worlds], self._friction_of[worlds] = conditions.wall_stiffness, conditions.friction
        self._set_contact(worlds, conditions)
        factor = conditions.shaft_stiffness
        for field, nominal, where in zip(
            self._springs, self._nominal, (self._shaft_joints, self._shaft_dofs, self._shaft_dofs), strict=True
        ):
            scale = factor.reshape(-1, *[1] * nominal.ndim)
            field[np.ix_(worlds, where)] = scale * nominal[where]
        if conditions.roll is not None:
            self._qpos[worlds, 1] = self._act[worlds, 1] = conditions.roll
        self._lock_outside()
        self._mocap_pos[worlds] = [0, 0, -AWAY]
        ids = np.sort(worlds)
        self._batch.forward(ids)
        centres = self._geom_xpos[worlds][:, self._spheres]
        self._walls.begin(worlds, case, centres[..., 2])
        self._before[worlds] = self._points[worlds] = centres
        self._normal_force[worlds] = 0.0

    def _set_contact(self, worlds: Int[np.ndarray, " reset"], conditions: Conditions) -> None:
        """Give these worlds' contacts their law: that of `haustra.models.wall.law`."""
        stiffness = conditions.wall_stiffness[:, None]
        damper = stiffness * self._damper_time
        soft = soft_contact(np, self._inverse_inertia, stiffness, damper, timestep=self._step_time)
        require_honoured(soft.impedance, what="A stiffness of the wall")
        where = np.ix_(worlds, self._pairs)
        self._friction[(*where, slice(2))] = conditions.friction[:, None, None]
        self._solref[where], self._solref_friction[where] = soft.solref, soft.sliding
        self._solimp[(*where, slice(2))] = soft.impedance[..., None]

    def step(
        self,
        push_rate: Float[np.ndarray, " worlds"],
        roll_rate: Float[np.ndarray, " worlds"],
        pulls: Float[np.ndarray, "worlds 4"],
        count: int,
    ) -> None:
        """Advance by `count` time steps. A world with inputs that are not finite is lost: MuJoCo zeroes them."""
        sound = np.isfinite(push_rate) & np.isfinite(roll_rate) & np.isfinite(pulls).all(axis=1)
        if not sound.all():
            self._lose(self.healthy & ~sound)
            push_rate, roll_rate = np.where(sound, push_rate, 0.0), np.where(sound, roll_rate, 0.0)
            pulls = np.where(sound[:, None], pulls, 0.0)
        self._ctrl[:, self._push] = push_rate
        self._ctrl[:, self._roll] = roll_rate
        self._ctrl[:, self._pulls] = pulls
        self._lock_outside()
        for step in range(count):
            with _TURN:
                if step:
                    self._catch_divergence()
                self._place_planes()
                ids = None if self.healthy.all() else np.flatnonzero(self.healthy)
            self._batch.step(ids)
        with _TURN:
            self._catch_divergence()
            self._seen = self._observe()  # here, since other threads may be stepping still

    def _place_planes(self) -> None:
        """Let colons give way to the last step's contacts, and put the planes where the wall is next to each sphere.

        What MuJoCo leaves are the spheres' places before its last step; they are carried on by the motion of that
        step, which is right to second order in the time step.
        """
        walls, worlds, h = self._walls, np.flatnonzero(self.healthy), self._step_time
        loops().carry_on(
            worlds,
            self._geom_xpos,
            self._spheres,
            self._before,
            self._points,
            walls.depth,
            walls.inwards,
            walls.wall_speed,
            self._stiffness,
            self._friction_of,
            self._ahead,
            SLIP_SPEED,
            h,
            self._on_wall,
            self._damping,
        )
        walls.give_way(worlds, self._on_wall, self._damping, h)
        before = walls.depth.copy()
        walls.look(worlds, self._points)
        stiffness, leaving = self._stiffness[:, None], (before - walls.depth) / h
        self._normal_force = normal_force(np, stiffness * before, stiffness * self._damper_time, leaving)
        loops().place_planes(
            worlds,
            self._points,
            walls.depth,
            walls.inwards,
            walls.wall_speed,
            self._radius,
            self._ahead,
            self._planes,
            self._plane_geoms,
            self._pairs,
            self._mocap_pos,
            self._mocap_quat,
            self._margin,
            self._surface,
        )

    def _catch_divergence(self) -> None:
        state = np.abs(self._qvel).max(axis=1)
        sound = (state < SPEED_LIMIT) & np.isfinite(self._qpos).all(axis=1)
        sound &= ~self._batch.warning[:, FATAL_WARNINGS, 1].any(axis=1)
        if not sound.all():
            self._lose(self.healthy & ~sound)

    def _lose(self, lost: Bool[np.ndarray, " worlds"]) -> None:
        """Take worlds out until they are reset. What is left of them is finite and stands still."""
        self.healthy &= ~lost
        self._batch.state[lost] = self._start_state
        self._batch.warning[lost] = 0
        self._batch.forward(np.flatnonzero(lost))
        self._before[lost] = self._points[lost] = self._geom_xpos[lost][:, self._spheres]

    def _lock_outside(self) -> None:
        """Hold joints straight that are outside the patient, and free them smoothly as they pass the anus."""
        insertion = self._scene.options.start_depth + self._qpos[:, :1]
        held = np.clip((self._behind - insertion) / LOCK_STRETCH, 0.0, 1.0) ** 4
        self._ctrl[:, self._locks] = held[:, :, None]

    def observe(self) -> dict[str, np.ndarray]:
        """The fields of `BatchObservation`, of these worlds."""
        self._seen = self._seen or self._observe()
        return self._seen

    def _observe(self) -> dict[str, np.ndarray]:
        qpos = self._qpos
        frame = self._site_xmat[:, self._tip].reshape(-1, 3, 3)
        sphere_forces = self._normal_force[..., None] * self._walls.inwards
        links = np.einsum("wsi,sl->wli", sphere_forces, self._members)
        return {
            "time": self._time.copy(),
            "insertion": self._scene.options.start_depth + qpos[:, 0],
            "roll": qpos[:, 1].copy(),
            "hand_lead": self._act[:, 0] - qpos[:, 0],
            "tip": self._site_xpos[:, self._tip].copy(),
            "tip_frame": frame.copy(),
            "tip_arc": self._walls.arcs[:, -1] + self._radius,
            "bend": np.stack([qpos[:, self._bend_up].sum(axis=1), -qpos[:, self._bend_left].sum(axis=1)], axis=1),
            "push_force": self._force[:, self._push].copy(),
            "torque": self._force[:, self._roll].copy(),
            "tip_force": np.einsum("wij,wi->wj", frame, links[:, self._tip_links].sum(axis=1)),
            "link_forces": np.linalg.norm(links, axis=2),
            "deepest": self._walls.depth.max(axis=1),
            "coils": self._geom_xpos[:, self._coils].copy(),
        }

    @property
    def shift(self) -> Float[np.ndarray, "worlds nodes 3"] | None:
        """Displacements of the colons' axes [m]; None where they are fixed."""
        moved = self._walls.shift
        return None if moved is None else moved.place.copy()

    def positions(self) -> Float[np.ndarray, "worlds joints"]:
        """Joint positions."""
        return self._qpos.copy()

    def snapshot(self, world: int) -> Snapshot:
        """Where one world is now."""
        return Snapshot(self._batch.state[world].copy(), self._before[world].copy(), self._walls.arcs[world].copy())

    def restore(self, world: int, snapshot: Snapshot) -> None:
        """Put one world where another was, in a colon at rest."""
        self._seen = None
        self._batch.state[world] = snapshot.state
        self._time[world] = 0.0
        self._batch.forward(np.array([world]))
        self._walls.begin(np.array([world]), self._walls.colon[[world]], snapshot.arcs[None])
        self._before[world] = self._points[world] = self._geom_xpos[world, self._spheres]
        self._normal_force[world] = 0.0

    def world_data(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one world."""
        return self._batch.get_model(world), self._batch.get_data(world)
