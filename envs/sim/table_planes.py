"""Tangent planes of the spheres of some worlds, put before every step where each world's table says the wall is."""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, Int
from mujoco.batch import Batch

from haustra.models.wall.compiled import loops
from haustra.models.wall.elasticity import ELASTICITIES, LINEAR, stiffest
from haustra.models.wall.law import SLIP_SPEED, SoftContact, honoured_contact, normal_force
from haustra.models.wall.lumen_table import Tables
from haustra.models.wall.planes import AWAY
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
    damping: Float[np.ndarray, "worlds spheres 2"]
    """Its damping along the wall's normal and across it [N s/m]."""
    load: Float[np.ndarray, "worlds spheres"]
    """Its part along the normal [N]."""
    spring: Float[np.ndarray, "worlds spheres"]
    """Stiffness of the wall there [N/m]."""
    treads: Float[np.ndarray, "worlds spheres 3"]
    """Speed of the spheres' surfaces against the spheres, in the scene's axes [m/s]."""


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
        elasticity: str = LINEAR,
        groups: Int[np.ndarray, " spheres"] | None = None,
        anus: Float[np.ndarray, "3"] | None = None,
        inwards: Float[np.ndarray, "3"] | None = None,
        starts: Float[np.ndarray, " colons"] | None = None,
        own_stiffness: Float[np.ndarray, " spheres"] | None = None,
        own_friction: Float[np.ndarray, " spheres"] | None = None,
        threaded: bool = False,
    ) -> None:
        """Find spheres, planes and pairs.

        Args:
            batch: the worlds.
            model: what they share.
            tables: of the colons, in the scene's coordinates; for each colon one a group of spheres of one radius.
            worlds: how many.
            count: spheres.
            damping_time: damping over stiffness of the wall [s].
            elasticity: name of the law by which the wall's force grows with depth.
            groups: number of the table of a colon that each sphere looks its place up in; the first when None.
            anus: where devices begin [m]; the origin when None.
            inwards: unit vector into the patient; z when None.
            starts: arc length of that place in each colon [m]; the anus when None.
            own_stiffness: of spheres that have their own [N/m]; NaN for the others.
            own_friction: of spheres that have their own [1]; NaN for the others.
            threaded: whether the spheres follow each other on a shaft, from its end to its tip, which a colon that
                moves draws on between them too (`haustra.models.wall.threads`).
        """
        self._threads = batch.bind("xfrc_applied") if threaded and tables.mesentery is not None else None
        self._threaded = threaded
        self._centres, self._bears = batch.bind("xipos"), False
        self._batch, self._step_time = batch, model.opt.timestep
        self._elastic = elasticity
        self._damper_time = damping_time + self._step_time
        """Damping over stiffness, and a step [s]."""
        self._mocap_pos, self._mocap_quat = batch.bind("mocap_pos"), batch.bind("mocap_quat")
        self._geom_xpos = batch.bind("geom_xpos")
        self._friction = batch.expand("pair_friction")
        self._solref, self._solimp = batch.expand("pair_solref"), batch.expand("pair_solimp")
        self._solref_friction, self._margin = batch.expand("pair_solreffriction"), batch.expand("pair_margin")
        self._disabled = np.zeros(0, np.int32) if tables.mesentery is None else batch.expand("opt.disableflags")
        self._surface = np.zeros((0, 0, 0)) if tables.mesentery is None else batch.expand("geom_surfacevel")
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SENSOR, "wall/felt_0000") >= 0:
            first = [model.sensor(f"wall/felt_{i:04d}").adr[0] for i in range(count)]
            self._sensed, self._columns = batch.bind("sensordata"), np.add.outer(first, np.arange(9))
        self.spheres = np.array([model.geom(f"wall/sphere_{i:04d}").id for i in range(count)])
        self.radius = model.geom_size[self.spheres, 0]
        self._pairs = np.array([model.pair(f"wall/plane_{i:04d}_0").id for i in range(count)])
        self._bodies = model.geom_bodyid[self.spheres]
        self._inverse_inertia = model.body_invweight0[self._bodies, 0]
        own = np.zeros(count, int) if groups is None else groups
        self._groups = [self._group(model, tables, worlds, np.flatnonzero(own == i)) for i in range(own.max() + 1)]
        for group in self._groups[1:]:
            group.walls.share_axis(self._groups[0].walls)
        self._anus = np.zeros(3) if anus is None else anus
        self._into = np.array([0.0, 0.0, 1.0]) if inwards is None else inwards
        self._starts = starts
        none = np.full(count, np.nan)
        self._own_stiffness = none if own_stiffness is None else own_stiffness
        self._own_friction = none if own_friction is None else own_friction
        self._rub = np.zeros((worlds, count))
        self.case = np.zeros(worlds, int)
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
            walls=TableWalls(tables, worlds, len(members), radius=radius, threaded=self._threaded),
            before=np.zeros((*shape, 3)),
            points=np.zeros((*shape, 3)),
            on_wall=np.zeros((*shape, 3)),
            damping=np.zeros((*shape, 2)),
            load=np.zeros(shape),
            spring=np.ones(shape),
            treads=np.zeros((*shape, 3)),
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
        stiffness = np.where(np.isnan(self._own_stiffness), wall_stiffness[:, None], self._own_stiffness)
        for group in self._groups:
            group.spring[worlds] = stiffness[:, group.members]
        self._rub[worlds] = np.where(np.isnan(self._own_friction), friction[:, None], self._own_friction)
        self._soft(np.where(np.isnan(self._own_stiffness), stiffest(self._elastic, stiffness), stiffness))
        soft = self._soft(stiffness)
        where = np.ix_(worlds, self._pairs)
        self._friction[(*where, slice(2))] = self._rub[worlds][..., None]
        self._solref[where], self._solref_friction[where] = soft.solref, soft.sliding
        self._solimp[(*where, slice(2))] = soft.impedance[..., None]

    def _springs(
        self, group: _Group, depth: Float[np.ndarray, "worlds spheres"]
    ) -> tuple[Float[np.ndarray, "worlds spheres"], Float[np.ndarray, "worlds spheres"]]:
        """Linear springs that touch the law at a depth [m]: how deep they would be pressed, and their stiffness.

        Where a device's own compliance stands for the wall's, it is linear.
        """
        if self._elastic == LINEAR:
            return depth, group.spring
        wall = np.isnan(self._own_stiffness[group.members])
        bent, firm = ELASTICITIES[self._elastic](np, depth, group.spring)
        return np.where(wall, bent, depth), np.where(wall, firm, group.spring)

    def _soft(self, stiffness: Float[np.ndarray, "reset spheres"]) -> SoftContact:
        own, what = (stiffness, stiffness * self._damper_time), "A stiffness of the wall"
        return honoured_contact(self._inverse_inertia, *own, timestep=self._step_time, what=what)

    def set_grip(self, share: Float[np.ndarray, "worlds spheres"]) -> None:
        """Leave each sphere a share of its friction [1]."""
        self._friction[:, self._pairs, :2] = (self._rub * share)[..., None]

    def run_treads(self, speed: Float[np.ndarray, "worlds spheres 3"]) -> None:
        """Say how the surfaces of spheres run over them, in the scene's axes [m/s]."""
        for group in self._groups:
            group.treads[:] = speed[:, group.members]

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
        if self._threads is not None:
            self._threads[worlds] = 0.0  # a snapshot holds what the shaft bore then
        self.rest(worlds)

    def rest(self, worlds: Int[np.ndarray, " reset"]) -> None:
        """Take what these worlds' devices did before for standing still."""
        for group in self._groups:
            group.before[worlds] = group.points[worlds] = self._geom_xpos[worlds][:, group.geoms]

    def place(self, worlds: Int[np.ndarray, " some"]) -> None:
        """Let colons give way to the last step's contacts, and put the planes where the wall is next to each sphere.

        What MuJoCo leaves are the spheres' places before its last step; they are carried on by the motion of that
        step, which is right to second order in the time step. A colon that moves would rock by that where walls are
        stiff: there places are asked for anew.
        """
        h, moves = self._step_time, self._groups[0].walls.displacement is not None
        if moves:
            self._step_axis(worlds)
        for group in self._groups:
            walls = group.walls
            if not moves:
                seen = self._geom_xpos[np.ix_(worlds, group.geoms)]
                group.points[worlds] = seen + (seen - group.before[worlds])
                group.before[worlds] = seen
            before = walls.depth.copy()
            walls.look(worlds, group.points)
            if self._threads is not None:
                self._thread(worlds, walls.thread(worlds, group.points), self._threads)
            if not moves:
                leaving = (before - walls.depth) / h
                bent, firm = self._springs(group, before)
                self.normal_force[:, group.members] = normal_force(np, firm * bent, firm * self._damper_time, leaving)
            depth, firm = self._springs(group, walls.depth)
            loops().place_planes(
                worlds,
                group.points,
                depth,
                walls.inwards,
                walls.wall_speed,
                group.radius,
                firm,
                self._elastic != LINEAR,
                self._ahead,
                self._inverse_inertia[group.members],
                h,
                group.planes,
                group.plane_geoms,
                group.pairs,
                self._mocap_pos,
                self._mocap_quat,
                self._margin,
                self._solref,
                self._solref_friction,
                self._solimp,
                self._surface,
            )

    def _thread(self, worlds: np.ndarray, borne: np.ndarray | None, applied: np.ndarray) -> None:
        """Let links bear what nodes are drawn to the shafts by, at their centres of mass."""
        if self._bears:
            applied[worlds], self._bears = 0.0, False
        if borne is None:
            return
        self._bears, bodies = True, self._bodies
        for world in worlds[borne[worlds].any(axis=(1, 2))]:
            force, moment = borne[world, :, :3], borne[world, :, 3:]
            away = self._geom_xpos[world][self.spheres] - self._centres[world][bodies]
            np.add.at(applied[world], bodies, np.hstack([force, moment + np.cross(away, force)]))

    def _step_axis(self, worlds: Int[np.ndarray, " some"]) -> None:
        """Let colons give way to what pressed on them in the last step."""
        felt = self._sensed.copy()  # asking for places overwrites it
        self._disabled |= _CONSTRAINT  # where spheres are does not depend on what they touch
        self._batch.forward(worlds, stage=mujoco.mjtStage.mjSTAGE_POS)
        self._disabled &= ~_CONSTRAINT
        for group in self._groups:
            loops().pressed(
                worlds,
                felt,
                self._columns[group.members, 0],
                self._geom_xpos,
                group.geoms,
                group.points,
                group.walls.inwards,
                group.walls.wall_speed,
                group.treads,
                self._springs(group, group.walls.depth)[1],
                self._ahead,
                SLIP_SPEED,
                self._step_time,
                group.load,
                group.on_wall,
                group.damping,
            )
            self.normal_force[:, group.members] = group.load
        first, *others = self._groups
        force, damping = first.on_wall, first.damping
        if others:
            force = np.concatenate([group.on_wall for group in self._groups], axis=1)
            damping = np.concatenate([group.damping for group in self._groups], axis=1)
        walls = [group.walls for group in others]
        first.walls.step_axis(worlds, force, damping, self._step_time, others=walls)

    def felt(self) -> tuple[Float[np.ndarray, "worlds spheres"], Float[np.ndarray, "worlds spheres 3"]]:
        """Normal force on each sphere in the last step, and its friction on the wall, as MuJoCo's sensors tell [N]."""
        felt = np.ascontiguousarray(self._sensed[:, self._columns])  # sums do not depend on how many worlds there are
        force, normal, tangent = felt[..., :3], felt[..., 3:6], felt[..., 6:]
        return force[..., 0], force[..., 1:2] * tangent + force[..., 2:] * np.cross(normal, tangent)

    @property
    def friction(self) -> Float[np.ndarray, "worlds spheres"]:
        """Coulomb's coefficient of the wall at each sphere, of which `set_grip` leaves a share [1]."""
        return self._rub

    def forces(self) -> Float[np.ndarray, "worlds spheres 3"]:
        """Normal force of the wall on each sphere [N]."""
        return self.normal_force[..., None] * self._gathered("inwards")

    def arcs_of(
        self,
        points: Float[np.ndarray, "worlds points 3"],
        arcs: Float[np.ndarray, "worlds points"],
        *,
        beyond: Float[np.ndarray, "worlds 3"] | None = None,
    ) -> Float[np.ndarray, "worlds points"]:
        """Arc lengths of other places of the devices, as `haustra.models.wall.table_wall.TableWalls.arcs_of` says."""
        return self._groups[0].walls.arcs_of(points, arcs, beyond=beyond)

    def _gathered(self, name: str) -> np.ndarray:
        """One array of all groups, spheres in their order."""
        first: np.ndarray = getattr(self._groups[0].walls, name)
        if len(self._groups) == 1:
            return first
        whole = np.zeros((first.shape[0], len(self.spheres), *first.shape[2:]))
        for group in self._groups:
            whole[:, group.members] = getattr(group.walls, name)
        return whole
