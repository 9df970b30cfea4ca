"""Tangent planes of the spheres of some worlds, put before every step where each world's table says the wall is."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, Int
from mujoco.batch import Batch

from haustra.errors import UnsupportedSceneError
from haustra.models.wall.compiled import loops
from haustra.models.wall.law import SLIP_SPEED, normal_force, require_honoured, soft_contact
from haustra.models.wall.lumen_table import Tables
from haustra.models.wall.planes import AWAY, Sample
from haustra.models.wall.table_wall import TableWalls

_CONSTRAINT = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)


@dataclass(frozen=True)
class _Group:
    """Spheres of one radius, which share a table of each colon."""

    members: Int[np.ndarray, " spheres"]
    """Numbers of the spheres."""
    geoms: Int[np.ndarray, " spheres"]
    radius: float
    planes: Int[np.ndarray, " spheres"]
    """Mocap bodies of their planes."""
    plane_geoms: Int[np.ndarray, " spheres"]
    pairs: Int[np.ndarray, " spheres"]
    walls: TableWalls
    before: Float[np.ndarray, "worlds spheres 3"]
    """Where the spheres were before the last step but one [m]."""
    points: Float[np.ndarray, "worlds spheres 3"]
    """Where they were when planes were put last [m]."""
    on_wall: Float[np.ndarray, "worlds spheres 3"]
    """Force on the wall in the last step [N]."""
    damping: Float[np.ndarray, "worlds spheres"]
    """Its damping [N s/m]."""


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
        starts: Float[np.ndarray, " colons"] | None = None,
        samples: Sequence[Sample] = (),
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
            anus: where devices begin [m]; the origin when None.
            inwards: unit vector into the patient; z when None.
            starts: arc length of that place in each colon [m]; the anus when None.
            samples: the spheres, where some have a stiffness or friction of their own.

        Raises:
            UnsupportedSceneError: when colons are to move and spheres have several radii.
        """
        self._batch, self._step_time = batch, model.opt.timestep
        self._damper_time = damping_time + self._step_time
        """c + h K over K [s]."""
        self._mocap_pos, self._mocap_quat = batch.bind("mocap_pos"), batch.bind("mocap_quat")
        self._geom_xpos = batch.bind("geom_xpos")
        self._friction = batch.expand("pair_friction")
        self._solref, self._solimp = batch.expand("pair_solref"), batch.expand("pair_solimp")
        self._solref_friction, self._margin = batch.expand("pair_solreffriction"), batch.expand("pair_margin")
        self._disabled = np.zeros(0, np.int32) if tables.mesentery is None else batch.expand("opt.disableflags")
        self._surface = np.zeros((0, 0, 0)) if tables.mesentery is None else batch.expand("geom_surfacevel")
        self.spheres = np.array([model.geom(f"wall/sphere_{i:04d}").id for i in range(count)])
        self.radius = model.geom_size[self.spheres, 0]
        self._pairs = np.array([model.pair(f"wall/plane_{i:04d}_0").id for i in range(count)])
        self._inverse_inertia = model.body_invweight0[model.geom_bodyid[self.spheres], 0]
        own = np.zeros(count, int) if groups is None else groups
        if tables.mesentery is not None and own.any():
            raise UnsupportedSceneError("Spheres of several radii cannot press on a colon that moves: give them one.")
        self._groups = [self._group(model, tables, worlds, np.flatnonzero(own == i)) for i in range(own.max() + 1)]
        self._anus = np.zeros(3) if anus is None else anus
        self._into = np.array([0.0, 0.0, 1.0]) if inwards is None else inwards
        self._starts = starts
        self._own_stiffness = _own([sample.stiffness for sample in samples], count)
        self._own_friction = _own([sample.friction for sample in samples], count)
        if tables.mesentery is not None and not np.isnan([*self._own_stiffness, *self._own_friction]).all():
            raise UnsupportedSceneError(
                "Spheres with stiffness or friction of their own cannot press on a colon that moves: leave it fixed."
            )
        self._spring, self._rub = np.ones((worlds, count)), np.zeros((worlds, count))
        self.case = np.zeros(worlds, int)
        self._stiffness, self._friction_of = np.ones(worlds), np.zeros(worlds)
        self._ahead = np.full(worlds, self._damper_time)
        self.normal_force = np.zeros((worlds, count))

    def _group(
        self, model: mujoco.MjModel, tables: Tables, worlds: int, members: Int[np.ndarray, " spheres"]
    ) -> _Group:
        names = [f"wall/plane_{i:04d}_0" for i in members]
        shape, radius = (worlds, len(members)), float(self.radius[members[0]])
        return _Group(
            members=members,
            geoms=self.spheres[members],
            radius=radius,
            planes=np.array([model.body_mocapid[model.body(name).id] for name in names]),
            plane_geoms=np.array([model.geom(name).id for name in names]),
            pairs=self._pairs[members],
            walls=TableWalls(tables, worlds, len(members), radius=radius),
            before=np.zeros((*shape, 3)),
            points=np.zeros((*shape, 3)),
            on_wall=np.zeros((*shape, 3)),
            damping=np.zeros(shape),
        )

    @property
    def arcs(self) -> Float[np.ndarray, "worlds spheres"]:
        """Arc length of each sphere [m]."""
        return self._gathered("arcs")

    @property
    def depth(self) -> Float[np.ndarray, "worlds spheres"]:
        """How deep each sphere is in the wall [m]; negative for room."""
        return self._gathered("depth")

    @property
    def displacement(self) -> Float[np.ndarray, "worlds nodes 7"] | None:
        """Poses of the colons' axes; None where they are fixed."""
        moved = self._groups[0].walls.displacement
        return None if moved is None else moved.pose.copy()

    def set_contact(
        self,
        worlds: Int[np.ndarray, " reset"],
        friction: Float[np.ndarray, " reset"],
        wall_stiffness: Float[np.ndarray, " reset"],
    ) -> None:
        """Give these worlds' contacts their law: that of `haustra.models.wall.law`."""
        self._stiffness[worlds], self._friction_of[worlds] = wall_stiffness, friction
        stiffness = np.where(np.isnan(self._own_stiffness), wall_stiffness[:, None], self._own_stiffness)
        damper = stiffness * self._damper_time
        self._spring[worlds] = stiffness
        self._rub[worlds] = np.where(np.isnan(self._own_friction), friction[:, None], self._own_friction)
        soft = soft_contact(np, self._inverse_inertia, stiffness, damper, timestep=self._step_time)
        require_honoured(soft.impedance, what="A stiffness of the wall")
        where = np.ix_(worlds, self._pairs)
        self._friction[(*where, slice(2))] = self._rub[worlds][..., None]
        self._solref[where], self._solref_friction[where] = soft.solref, soft.sliding
        self._solimp[(*where, slice(2))] = soft.impedance[..., None]

    def set_grip(self, share: Float[np.ndarray, "worlds spheres"]) -> None:
        """Leave each sphere a share of its friction [1]."""
        self._friction[:, self._pairs, :2] = (self._rub * share)[..., None]

    def park(self, worlds: Int[np.ndarray, " reset"]) -> None:
        """Take the planes of these worlds out of the way."""
        self._mocap_pos[worlds] = [0, 0, -AWAY]

    def begin(self, worlds: Int[np.ndarray, " reset"]) -> None:
        """Start looking anew in these worlds, whose devices lie straight at the anus and whose colons are at rest."""
        begun = 0.0 if self._starts is None else self._starts[self.case[worlds]][:, None]
        self.resume(worlds, begun + (self._geom_xpos[worlds][:, self.spheres] - self._anus) @ self._into)

    def resume(self, worlds: Int[np.ndarray, " reset"], arcs: Float[np.ndarray, "*reset spheres"]) -> None:
        """Go on from where those devices are now, beside these arc lengths [m], in colons at rest."""
        for number, group in enumerate(self._groups):
            tables = self.case[worlds] * len(self._groups) + number
            group.walls.begin(worlds, tables, arcs[:, group.members])
        self.normal_force[worlds] = 0.0
        self.rest(worlds)

    def rest(self, worlds: Int[np.ndarray, " reset"]) -> None:
        """Take what these worlds' devices did before for standing still."""
        for group in self._groups:
            group.before[worlds] = group.points[worlds] = self._geom_xpos[worlds][:, group.geoms]

    def place(self, worlds: Int[np.ndarray, " some"]) -> None:
        """Let colons give way to the last step's contacts, and put the planes where the wall is next to each sphere.

        What MuJoCo leaves are the spheres' places before its last step; they are carried on by the motion of that
        step, which is right to second order in the time step. A colon that moves must know how fast it was pressed in
        the last step, or it rocks where walls are stiff: there places are asked for anew.
        """
        moves = self._groups[0].walls.displacement is not None
        if moves:  # where spheres are does not depend on what they touch
            self._disabled |= _CONSTRAINT
            self._batch.forward(worlds, stage=mujoco.mjtStage.mjSTAGE_POS)
            self._disabled &= ~_CONSTRAINT
        h = self._step_time
        for group in self._groups:
            walls = group.walls
            loops().carry_on(
                worlds,
                self._geom_xpos,
                group.geoms,
                group.before,
                group.points,
                walls.depth,
                walls.inwards,
                walls.wall_speed,
                self._stiffness,
                self._friction_of,
                self._ahead,
                SLIP_SPEED,
                h,
                float(not moves),
                group.on_wall,
                group.damping,
            )
            walls.give_way(worlds, group.on_wall, group.damping, h)
            before = walls.depth.copy()
            walls.look(worlds, group.points)
            leaving, stiffness = (before - walls.depth) / h, self._spring[:, group.members]
            self.normal_force[:, group.members] = normal_force(
                np, stiffness * before, stiffness * self._damper_time, leaving
            )
            loops().place_planes(
                worlds,
                group.points,
                walls.depth,
                walls.inwards,
                walls.wall_speed,
                group.radius,
                self._ahead,
                group.planes,
                group.plane_geoms,
                group.pairs,
                self._mocap_pos,
                self._mocap_quat,
                self._margin,
                self._surface,
            )

    def forces(self) -> Float[np.ndarray, "worlds spheres 3"]:
        """Normal force of the wall on each sphere [N]."""
        return self.normal_force[..., None] * self._gathered("inwards")

    def arcs_of(
        self, points: Float[np.ndarray, "worlds points 3"], arcs: Float[np.ndarray, "worlds points"]
    ) -> Float[np.ndarray, "worlds points"]:
        """Arc lengths of other places of the devices [m], which were near `arcs` [m] at the last look."""
        return self._groups[0].walls.arcs_of(points, arcs)

    def _gathered(self, name: str) -> np.ndarray:
        """One array of all groups, spheres in their order."""
        first: np.ndarray = getattr(self._groups[0].walls, name)
        if len(self._groups) == 1:
            return first
        whole = np.zeros((first.shape[0], len(self.spheres), *first.shape[2:]))
        for group in self._groups:
            whole[:, group.members] = getattr(group.walls, name)
        return whole


def _own(values: Sequence[float | None], count: int) -> Float[np.ndarray, " spheres"]:
    """What spheres have of their own; NaN for those that have nothing."""
    return np.array([np.nan if value is None else value for value in values] or [np.nan] * count)
