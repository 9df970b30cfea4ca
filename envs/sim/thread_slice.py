"""The worlds of one thread: planes placed, locks set, MuJoCo stepped, divergence caught."""

from threading import Lock

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int
from mujoco.batch import Batch

from haustra.envs.sim.coils import coil_samples
from haustra.envs.sim.conditions import Conditions, Snapshot
from haustra.envs.sim.link_places import link_arcs, middle_spheres
from haustra.envs.sim.native import FATAL_WARNINGS
from haustra.envs.sim.physics.hand import hand_force
from haustra.envs.sim.physics.lock import lock_activation
from haustra.envs.sim.physics.wires import sheath_angle
from haustra.envs.sim.state import SPEED_LIMIT
from haustra.envs.sim.table_planes import TablePlanes
from haustra.models.devices.scope.wires import WIRE_NAMES, arriving_pulls
from haustra.models.scene import Scene
from haustra.models.wall.lumen_table import Tables

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
        self._geom_xpos = batch.bind("geom_xpos")
        self._site_xpos, self._site_xmat = batch.bind("site_xpos"), batch.bind("site_xmat")
        options = scene.options
        self._wall = TablePlanes(
            batch,
            model,
            tables,
            worlds=worlds,
            count=len(scene.samples),
            damping_time=options.wall_damping_time,
            elasticity=options.elasticity,
            threaded=True,
        )
        self._springs = [batch.expand(name) for name in ("jnt_stiffness", "dof_damping", "dof_armature")]
        self._gravity, self._axes = batch.expand("opt.gravity"), tables.axes
        self._find(cable)
        self._nominal = [np.array(getattr(model, name)) for name in ("jnt_stiffness", "dof_damping", "dof_armature")]
        self._start_state = batch.state[0].copy()
        self.healthy: Bool[np.ndarray, " worlds"] = np.ones(worlds, bool)
        self._arriving = np.zeros((worlds, len(WIRE_NAMES)))
        self._tip_arcs = np.zeros((worlds, 1))
        self._seen: dict[str, np.ndarray] | None = None

    def _find(self, cable) -> None:
        model, samples = self._model, self._scene.samples
        count = len(samples)
        links = {name: index for index, name in enumerate(cable.links)}
        of_link = np.array([links[sample.body] for sample in samples])
        self._members = np.zeros((count, len(links)))
        self._members[np.arange(count), of_link] = 1.0
        self._middle = middle_spheres(of_link, len(links))
        self._push, self._roll = model.actuator("scope/push").id, model.actuator("scope/roll").id
        self._hand_limits = model.actuator_forcerange[[self._push, self._roll], 1]
        self._pulls = np.array([model.actuator(f"scope/pull_{name}").id for name in WIRE_NAMES])
        self._locks = np.array([[model.actuator(name).id for name in pair] for pair in cable.locks])
        self._behind = cable.length - cable.joint_positions
        self._tip = model.site("scope/tip").id
        self._coils = self._wall.spheres[coil_samples(model, samples)]
        joints = [(side, index) for index, cell in enumerate(cable.cells) for side in "xy"]
        steerable = [index for index, cell in enumerate(cable.cells) if cell.steerable]
        self._tip_links = np.array([cable.links.index(f"scope/link_{index:03d}") for index in steerable])
        shaft = [model.joint(f"scope/bend_{side}_{i:03d}").id for side, i in joints if i not in steerable]
        self._shaft_joints = np.array(shaft)
        self._shaft_dofs = model.jnt_dofadr[self._shaft_joints]
        self._sheath = model.jnt_qposadr[self._shaft_joints].reshape(-1, 2).T
        self._bend_up, self._bend_left = (
            np.array([model.joint(f"scope/bend_{side}_{i:03d}").qposadr[0] for i in steerable]) for side in "yx"
        )

    def reset(self, worlds: Int[np.ndarray, " reset"], case: Int[np.ndarray, " reset"], conditions: Conditions) -> None:
        """Begin again in these worlds."""
        self._seen = None
        self._batch.state[worlds] = self._start_state
        self._batch.warning[worlds] = 0
        self.healthy[worlds] = True
        self._wall.case[worlds] = case
        self._wall.set_contact(worlds, conditions.friction, conditions.wall_stiffness)
        self._gravity[worlds] = np.array(self._scene.options.gravity) @ self._axes[case]
        factor = conditions.shaft_stiffness
        for field, nominal, where in zip(
            self._springs, self._nominal, (self._shaft_joints, self._shaft_dofs, self._shaft_dofs), strict=True
        ):
            scale = factor.reshape(-1, *[1] * nominal.ndim)
            field[np.ix_(worlds, where)] = scale * nominal[where]
        if conditions.roll is not None:
            self._qpos[worlds, 1] = self._act[worlds, 1] = conditions.roll
        self._lock_outside()
        self._wall.park(worlds)
        ids = np.sort(worlds)
        self._batch.forward(ids)
        self._wall.begin(worlds)
        self._tip_arcs[worlds] = self._scene.options.start_depth
        self._arriving[worlds] = 0.0

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
        self._ctrl[:, self._pulls] = self._arrive(pulls)
        self._lock_outside()
        for step in range(count):
            with _TURN:
                if step:
                    self._catch_divergence()
                self._wall.place(np.flatnonzero(self.healthy))
                ids = None if self.healthy.all() else np.flatnonzero(self.healthy)
            self._batch.step(ids)
        with _TURN:
            self._catch_divergence()
            self._seen = self._observe()  # here, since other threads may be stepping still

    def _arrive(self, pulls: Float[np.ndarray, "worlds 4"]) -> Float[np.ndarray, "worlds 4"]:
        """What of the hands' pulls gets through the bent shafts to the bending sections [N]."""
        wires, about = self._scene.design.wires, self._sheath
        angle = sheath_angle(np, self._qpos[:, about[0]], self._qpos[:, about[1]])[:, None]
        losses = {"friction": wires.friction, "hysteresis": wires.hysteresis}
        self._arriving = arriving_pulls(np, pulls, self._arriving, **losses, sheath_angle=angle)
        return self._arriving

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
        self._wall.rest(np.flatnonzero(lost))

    def _lock_outside(self) -> None:
        """Hold joints straight that are outside the patient, and free them smoothly as they pass the anus."""
        insertion = self._scene.options.start_depth + self._qpos[:, :1]
        held = lock_activation(np, insertion, self._behind)
        self._ctrl[:, self._locks] = held[:, :, None]

    def read(self) -> dict[str, np.ndarray]:
        """The fields of `Readings`, of these worlds."""
        self._seen = self._seen or self._observe()
        return self._seen

    def _observe(self) -> dict[str, np.ndarray]:
        qpos, tip = self._qpos, self._site_xpos[:, self._tip].copy()
        last = self._geom_xpos[:, self._wall.spheres[-1]]
        self._tip_arcs = self._wall.arcs_of(tip[:, None], self._tip_arcs, beyond=last)
        frame = self._site_xmat[:, self._tip].reshape(-1, 3, 3)
        links = np.einsum("wsi,sl->wli", self._wall.forces(), self._members)
        # What MuJoCo leaves is that of the beginning of its last step.
        hand = hand_force(np, self._act[:, :2], qpos[:, :2], self._qvel[:, :2], self._hand_limits)
        return {
            "time": self._time.copy(),
            "insertion": self._scene.options.start_depth + qpos[:, 0],
            "roll": qpos[:, 1].copy(),
            "hand_lead": self._act[:, 0] - qpos[:, 0],
            "tip": tip,
            "tip_frame": frame.copy(),
            "tip_arc": self._tip_arcs[:, 0].copy(),
            "bend": np.stack([qpos[:, self._bend_up].sum(axis=1), -qpos[:, self._bend_left].sum(axis=1)], axis=1),
            "push_force": hand[:, 0],
            "torque": hand[:, 1],
            "tip_force": np.einsum("wij,wi->wj", frame, links[:, self._tip_links].sum(axis=1)),
            "link_forces": np.linalg.norm(links, axis=2),
            "link_arcs": link_arcs(self._wall.arcs, self._middle),
            "deepest": self._wall.depth.max(axis=1),
            "coils": self._geom_xpos[:, self._coils].copy(),
        }

    @property
    def displacement(self) -> Float[np.ndarray, "worlds nodes 7"] | None:
        """Displacements of the colons' axes [m]; None where they are fixed."""
        return self._wall.displacement

    def positions(self) -> Float[np.ndarray, "worlds joints"]:
        """Joint positions."""
        return self._qpos.copy()

    def snapshot(self, world: int) -> Snapshot:
        """Where one world is now."""
        parts = (self._batch.state, self._wall.arcs, self._arriving)
        return Snapshot(*(part[world].copy() for part in parts))

    def restore(self, world: int, snapshot: Snapshot) -> None:
        """Put one world where another was, in a colon at rest."""
        self._seen = None
        self._batch.state[world] = snapshot.state
        self._time[world] = 0.0
        self._batch.forward(np.array([world]))
        self._wall.resume(np.array([world]), snapshot.arcs[None])
        self._tip_arcs[world] = snapshot.arcs[-1]
        self._arriving[world] = snapshot.pulls

    def world_data(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one world."""
        return self._batch.get_model(world), self._batch.get_data(world)
