"""Tangent planes of the spheres of some worlds, put before every step where each world's table says the wall is."""

import mujoco
import numpy as np
from jaxtyping import Float, Int
from mujoco.batch import Batch

from haustra.models.wall.law import normal_force, require_honoured, soft_contact
from haustra.models.wall.lumen_table import Tables, touch
from haustra.models.wall.plane_pose import plane_pose
from haustra.models.wall.planes import AWAY

ROOM = 0.01
"""A plane is parked while its sphere has more room than this [m]: two steps at 1 m/s, well above any motion here."""
_OUTSIDE = 0.03
"""A sphere is not looked up while it is farther than this before the anus [m]: in one step none comes that far."""


class TablePlanes:
    """One plane a sphere (`haustra.models.wall.planes.add_planes`) of any device, in the worlds of one batch."""

    def __init__(
        self,
        batch: Batch,
        model: mujoco.MjModel,
        tables: Tables,
        *,
        worlds: int,
        count: int,
        damping_time: float,
        groups: Int[np.ndarray, " spheres"] | None = None,
        anus: Float[np.ndarray, "3"] | None = None,
        inwards: Float[np.ndarray, "3"] | None = None,
    ) -> None:
        """Find spheres, planes and pairs.

        Args:
            batch: the worlds.
            model: what they share.
            tables: of the colons, in the scene's coordinates; for each colon one a group of spheres of one radius.
            worlds: how many.
            count: spheres.
            damping_time: damping over stiffness of the wall [s].
            groups: number of the table of a colon that each sphere looks its place up in; the first when None.
            anus: where the colons begin [m]; the origin when None.
            inwards: unit vector into the patient; z when None.
        """
        self._batch, self._stack, self._step_time = batch, tables, model.opt.timestep
        self._damper_time = damping_time + self._step_time
        """c + h K over K [s]."""
        self._mocap_pos, self._mocap_quat = batch.bind("mocap_pos"), batch.bind("mocap_quat")
        self._geom_xpos = batch.bind("geom_xpos")
        self._friction = batch.expand("pair_friction")
        self._solref, self._solimp = batch.expand("pair_solref"), batch.expand("pair_solimp")
        self._solref_friction, self._margin = batch.expand("pair_solreffriction"), batch.expand("pair_margin")
        self.spheres = np.array([model.geom(f"wall/sphere_{i:04d}").id for i in range(count)])
        self.radius = model.geom_size[self.spheres, 0]
        self._planes = np.array([model.body_mocapid[model.body(f"wall/plane_{i:04d}_0").id] for i in range(count)])
        self._pairs = np.array([model.pair(f"wall/plane_{i:04d}_0").id for i in range(count)])
        self._inverse_inertia = model.body_invweight0[model.geom_bodyid[self.spheres], 0]
        self._groups = np.zeros(count, int) if groups is None else groups
        self._anus = np.zeros(3) if anus is None else anus
        self._into = np.array([0.0, 0.0, 1.0]) if inwards is None else inwards
        self.case = np.zeros(worlds, int)
        self._stiffness = np.zeros(worlds)
        self.arcs = np.zeros((worlds, count))
        self.depth = np.full((worlds, count), -1.0)
        self.inwards = np.zeros((worlds, count, 3))
        self.normal_force = np.zeros((worlds, count))
        self.before = np.zeros((worlds, count, 3))

    def set_contact(
        self,
        worlds: Int[np.ndarray, " reset"],
        friction: Float[np.ndarray, " reset"],
        wall_stiffness: Float[np.ndarray, " reset"],
    ) -> None:
        """Give these worlds' contacts their law: that of `haustra.models.wall.law`."""
        self._stiffness[worlds] = wall_stiffness
        stiffness = wall_stiffness[:, None]
        damper = stiffness * self._damper_time
        soft = soft_contact(np, self._inverse_inertia, stiffness, damper, timestep=self._step_time)
        require_honoured(soft.impedance, what="A stiffness of the wall")
        where = np.ix_(worlds, self._pairs)
        self._friction[(*where, slice(2))] = friction[:, None, None]
        self._solref[where], self._solref_friction[where] = soft.solref, soft.sliding
        self._solimp[(*where, slice(2))] = soft.impedance[..., None]

    def park(self, worlds: Int[np.ndarray, " reset"]) -> None:
        """Take the planes of these worlds out of the way."""
        self._mocap_pos[worlds] = [0, 0, -AWAY]

    def begin(self, worlds: Int[np.ndarray, " reset"]) -> None:
        """Start looking anew in these worlds, whose devices lie straight at the anus."""
        centres = self._geom_xpos[worlds][:, self.spheres]
        self.arcs[worlds] = self._along(centres)
        self.before[worlds] = centres
        self.depth[worlds], self.normal_force[worlds] = -1.0, 0.0

    def resume(self, worlds: Int[np.ndarray, " reset"], arcs: Float[np.ndarray, "*reset spheres"]) -> None:
        """Go on from where those devices are now, beside these arc lengths [m]."""
        self.rest(worlds)
        self.arcs[worlds] = arcs
        self.depth[worlds], self.normal_force[worlds] = -1.0, 0.0

    def rest(self, worlds: Int[np.ndarray, " reset"]) -> None:
        """Take what these worlds' devices did before for standing still."""
        self.before[worlds] = self._geom_xpos[worlds][:, self.spheres]

    def place(self) -> None:
        """Put the planes where the wall is next to each sphere.

        What MuJoCo leaves are the spheres' places before its last step; they are carried on by the motion of that
        step, which is right to second order in the time step.
        """
        seen = self._geom_xpos[:, self.spheres]
        centres = 2 * seen - self.before
        self.before = seen
        world, sphere = near = np.nonzero(self.arcs > -_OUTSIDE)
        points = centres[near]
        found = touch(np, self._tables_of(world, sphere), points, self.arcs[near])
        stiffness, before = self._stiffness[world], self.depth[near]
        leaving = (before - found.depth) / self._step_time
        force = normal_force(np, stiffness * before, stiffness * self._damper_time, leaving)
        self.arcs = self._along(centres)  # before the anus a device is straight
        self.arcs[near], self.depth[near], self.inwards[near] = found.arcs, found.depth, found.inwards
        self.normal_force[near] = force
        depth = np.where(found.depth < -ROOM, -AWAY, found.depth)
        pose = plane_pose(np, points, self.radius[sphere], depth, found.inwards)
        planes = self._planes[sphere]
        self._mocap_pos[world, planes], self._mocap_quat[world, planes] = pose.position, pose.turn
        self._margin[world, self._pairs[sphere]] = pose.margin

    def forces(self) -> Float[np.ndarray, "worlds spheres 3"]:
        """Normal force of the wall on each sphere [N]."""
        return self.normal_force[..., None] * self.inwards

    def _along(self, centres: Float[np.ndarray, "*rows 3"]) -> Float[np.ndarray, "*rows"]:
        """How far along the way in each centre is [m]."""
        return (centres - self._anus) @ self._into

    def _tables_of(self, world: Int[np.ndarray, " points"], sphere: Int[np.ndarray, " points"]) -> Tables:
        """Tables with one colon a point."""
        number = self.case[world] * (self._groups.max() + 1) + self._groups[sphere]
        chosen = {name: getattr(self._stack, name)[number] for name in ("step", "first", "count")}
        return self._stack._replace(**chosen)
