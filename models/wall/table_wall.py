"""Walls by the lumen's table for worlds that MuJoCo steps: a tangent plane beside each sphere before every step.

The place of each sphere is looked up in the table of its colon, and a plane, a mocap body, is put there, so that MuJoCo
does the contact, implicitly and with the exact stiffness of `haustra.models.wall.law`. A colon on its mesentery gives
way to what presses on it after the step (`haustra.models.wall.moving_colon`).
"""

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
from jaxtyping import Float, Int

from haustra.models.wall import contact_solver
from haustra.models.wall.compiled import loops
from haustra.models.wall.elasticity import ELASTICITIES, LINEAR, stored_energy
from haustra.models.wall.law import SLIP_SPEED, WallContact, contact_parameters
from haustra.models.wall.loops import STALE
from haustra.models.wall.lumen_table import LumenTable, Tables, pick, stack
from haustra.models.wall.mesentery import Mesentery
from haustra.models.wall.moving_colon import AT_REST, POSE, AxisDisplacement, AxisShape
from haustra.models.wall.threads import threaded_arc

_FIXED, _ONE = np.zeros((0, 0, 0)), np.zeros(1, int)


class TableWalls:
    """Walls of some worlds, each of one of some colons. Arrays are written in place."""

    def __init__(self, tables: Tables, worlds: int, spheres: int, *, radius: float, threaded: bool = False) -> None:
        """All worlds have the first colon, at rest; `tables` are of all, stacked, for spheres of `radius` [m].

        Those that are `threaded` follow each other on a shaft, from its end to its tip
        (`haustra.models.wall.threads`).
        """
        self._all, self._radius, self._threaded = tables, radius, threaded
        self.arcs: Float[np.ndarray, "worlds spheres"] = np.zeros((worlds, spheres))
        """Arc length of each sphere [m]."""
        self.depth: Float[np.ndarray, "worlds spheres"] = np.full((worlds, spheres), -1.0)
        """How deep each is in the wall [m]; negative for room."""
        self.inwards: Float[np.ndarray, "worlds spheres 3"] = np.zeros((worlds, spheres, 3))
        """Normal of the wall next to it."""
        self.wall_speed: Float[np.ndarray, "worlds spheres 3"] = np.zeros((worlds, spheres, 3))
        """Speed of the wall there [m/s]."""
        self.lever: Float[np.ndarray, "worlds spheres 3"] = np.zeros((worlds, spheres, 3))
        """From the axis at rest to where it holds on to the wall [m]."""
        self.colon: Int[np.ndarray, " worlds"] = np.zeros(worlds, int)
        """Which colon each world has."""
        self.displacement: AxisDisplacement | None = None
        """Where the axes are, for colons that move."""
        self._more: Float[np.ndarray, "worlds nodes 3"] | float = 0.0
        self.time: Float[np.ndarray, " worlds"] = np.zeros(worlds)
        """For how long axes have moved since they were at rest [s]: breath goes by it."""
        self._way, self._partners = np.full(worlds, STALE), np.zeros((worlds, 0), int)
        self._drawn, self._borne = np.zeros((worlds, 0, 4)), np.zeros((worlds, spheres, 6))
        if tables.mesentery is not None:
            nodes = tables.mesentery.nodes.shape[1]

            def zeros(*shape: int) -> np.ndarray:
                return np.zeros((worlds, *shape))

            self.displacement = AxisDisplacement(zeros(nodes, POSE), zeros(nodes, 4))
            edges, flat = (zeros(nodes - 1, 3), zeros(nodes - 1)), (zeros(nodes), zeros(nodes, 3))
            self._partners, self._drawn = np.full((worlds, nodes), -1), zeros(nodes, 4)
            self._shape = AxisShape(*edges, zeros(nodes, 3), zeros(nodes), zeros(nodes, 4), zeros(nodes - 1, 3), *flat)
        self.begin(np.arange(worlds), self.colon, self.arcs)
        none = np.zeros(0, int)  # what is compiled is compiled before the first step
        self.look(none, self.inwards)
        self.thread(none, self.inwards)
        self.step_axis(none, self.inwards, np.zeros((*self.depth.shape, 2)), 0.0)

    @property
    def table(self) -> Float[np.ndarray, "stations angles 4"]:
        """The wall that all worlds look up, to be written to (`Tables.wall`)."""
        return self._tables.wall

    def begin(
        self,
        worlds: Int[np.ndarray, " some"],
        colons: Int[np.ndarray, " some"],
        arcs: Float[np.ndarray, "some spheres"],
    ) -> None:
        """Take these colons, at rest, in these worlds, whose spheres are at those arc lengths [m]."""
        self.colon[worlds] = colons
        self.arcs[worlds], self.depth[worlds] = arcs, -1.0
        picked = pick(self._all, self.colon)
        self._own: Mesentery | None = picked.mesentery
        self.weigh(self._more)
        self._tables = picked._replace(mesentery=None)
        if self.displacement is not None:
            self.displacement.pose[worlds], self.displacement.speed[worlds] = AT_REST, 0.0
            self.time[worlds], self._way[worlds] = 0.0, STALE

    def weigh(self, more: Float[np.ndarray, "worlds nodes 3"] | float) -> None:
        """Let so much weigh on the nodes of the axes besides what their mesenteries say [N]."""
        self._more, hung = more, self._all.mesentery
        if self._own is not None and hung is not None:
            self._own.load[:] = hung.load[self.colon] + more

    def lose_pressure(self, lost: Float[np.ndarray, " worlds"]) -> None:
        """Let gas thrust colons' ends apart by so much less than when they were imaged, over their area then [Pa]."""
        if self._own is not None:
            self._own.pressure_lost[:] = lost

    def look(self, worlds: Int[np.ndarray, " some"], points: Float[np.ndarray, "worlds spheres 3"]) -> None:
        """Find the wall next to the spheres of these worlds [m]."""
        found = self.arcs, self.depth, self.inwards
        if self.displacement is None:
            loops().query(self._tables, worlds, points, *found)
            return
        loops().query_moved(
            self._tables,
            self._own,
            worlds,
            *self.displacement,
            self._shape,
            self._radius,
            self._threaded,
            points,
            *found,
            self.lever,
            self.wall_speed,
        )

    def thread(
        self, worlds: Int[np.ndarray, " some"], points: Float[np.ndarray, "worlds spheres 3"]
    ) -> Float[np.ndarray, "worlds spheres 6"] | None:
        """Draw nodes to a shaft between its spheres in the next step of the axes (`haustra.models.wall.threads`).

        Args:
            worlds: which.
            points: middles of the spheres, which were looked up there, from the shaft's end to its tip [m].

        Returns:
            Force on each sphere and its moment about it [N], [N m]; None where there is none.
        """
        if self.displacement is None:
            return None
        given = self._own, worlds, self.displacement.pose, points, self.arcs, self._drawn, self._borne
        return self._borne if loops().thread(*given) else None

    def arcs_of(
        self,
        points: Float[np.ndarray, "worlds points 3"],
        arcs: Float[np.ndarray, "worlds points"],
        *,
        beyond: Float[np.ndarray, "worlds 3"] | None = None,
    ) -> Float[np.ndarray, "worlds points"]:
        """Arc lengths of other places than the spheres' [m], which were near `arcs` [m] at the last look.

        One look leaves in bends a share of the way since the last, which may be many time steps ago: there are two.

        Args:
            points: the places [m].
            arcs: theirs at the last look [m].
            beyond: the last sphere's middle, where the places follow that on a shaft [m]
                (`haustra.models.wall.threads`).
        """
        worlds, found = np.arange(len(points)), arcs.copy()
        rest, lever, speed = np.zeros(arcs.shape), np.zeros(points.shape), np.zeros(points.shape)
        for _ in range(2):
            if self.displacement is None:
                loops().query(self._tables, worlds, points, found, rest, lever)
            else:
                about = self._tables, self._own, worlds, *self.displacement, self._shape, self._radius, False
                loops().query_moved(*about, points, found, rest, np.zeros(points.shape), lever, speed)
        if beyond is None or self.displacement is None:
            return found
        return threaded_arc(np, found, self.arcs[:, -1:], np.linalg.norm(points - beyond[:, None], axis=-1))

    def resume(self, other: "TableWalls") -> None:
        """Take over where the same colons have moved to in another scene."""
        if self.displacement is not None and other.displacement is not None:
            for mine, theirs in zip(self.displacement, other.displacement, strict=True):
                mine[:] = theirs
            self.time[:], self._way[:] = other.time, STALE

    def share_axis(self, other: "TableWalls") -> None:
        """Take the axes of other spheres of the same colons for one's own."""
        self.displacement = other.displacement

    def step_axis(
        self,
        worlds: Int[np.ndarray, " some"],
        force: Float[np.ndarray, "worlds all 3"],
        damping: Float[np.ndarray, "worlds all 2"],
        timestep: float,
        *,
        others: Sequence["TableWalls"] = (),
    ) -> None:
        """Let the axes of these worlds move for a step [s] under forces on the wall [N], damped at least so [N s/m].

        Forces, and damping along the normal and across it, are of these spheres, then of others that share the axes.
        """
        if self.displacement is None:
            return
        arcs, lever = self.arcs, self.lever
        if others:
            arcs = np.concatenate([arcs, *(other.arcs for other in others)], axis=1)
            lever = np.concatenate([lever, *(other.lever for other in others)], axis=1)
        self.move(worlds, (arcs, lever, force, damping), timestep)

    def move(self, worlds: Int[np.ndarray, " some"], held: tuple[np.ndarray, ...], timestep: float) -> None:
        """Let the axes of these worlds move for a step [s] where devices hold on to the wall.

        Args:
            worlds: which.
            held: arc lengths [m], levers [m], forces on the wall [N] and damping [N s/m] there.
            timestep: [s].
        """
        assert self.displacement is not None
        moved = *self.displacement, self._shape
        around = self.time, self._partners, self._way, self._drawn
        loops().step_axis(self._own, worlds, *moved, *held, timestep, *around)
        self.time[worlds] += timestep


class LinkLoads:
    """What the links of one scene bear of nodes that are drawn to the shaft (`haustra.models.wall.threads`)."""

    def __init__(self, model: mujoco.MjModel, spheres: Int[np.ndarray, " spheres"]) -> None:
        """Take the spheres along the shaft; nothing is borne yet."""
        self._model, self._spheres = model, spheres
        self._bodies, self._bears = model.geom_bodyid[spheres], False

    def put(self, data: mujoco.MjData, borne: Float[np.ndarray, "1 spheres 6"] | None) -> None:
        """Let links bear this in the next step, by generalised forces; kinematics are those of the spheres' places."""
        if self._bears:
            data.qfrc_applied[:], self._bears = 0.0, False
        if borne is None:
            return
        self._bears = True
        mujoco.mj_comPos(self._model, data)
        for sphere in np.flatnonzero(borne[0].any(axis=1)):
            force, moment, body = borne[0, sphere, :3], borne[0, sphere, 3:], self._bodies[sphere]
            place = data.geom_xpos[self._spheres[sphere]]
            mujoco.mj_applyFT(self._model, data, force, moment, place, body, data.qfrc_applied)


class TableLook:
    """Where the spheres of one world are along its colon, and how deep in its wall, where other walls press on them."""

    def __init__(
        self, model: mujoco.MjModel, spheres: Int[np.ndarray, " spheres"], tables: Tables, *, threaded: bool = False
    ) -> None:
        """Take a colon's tables, stacked, of which the last is looked up in; spheres of other radii are shifted.

        Those that are `threaded` follow each other on a shaft, from its end to its tip.
        """
        self.spheres, self._colon = spheres, np.array([len(tables.count) - 1])
        radius = float(tables.device_radius[-1])
        self._walls = TableWalls(tables, 1, len(spheres), radius=radius, threaded=threaded)
        self._shift = model.geom_size[spheres, 0] - float(tables.device_radius[-1])
        self.axis: Tables = pick(tables, self._colon)
        """Tables of the colon that is looked up in."""
        self._loads = LinkLoads(model, spheres)

    def thread(self, data: mujoco.MjData) -> None:
        """Draw nodes to the shaft that the spheres follow each other on, in the next step of both.

        To be called where kinematics are those of the step's beginning.
        """
        points = data.geom_xpos[self.spheres][None]
        self._walls.look(_ONE, points)
        self._loads.put(data, self._walls.thread(_ONE, points))

    def move(self, held: tuple[np.ndarray, ...], timestep: float) -> None:
        """Let its axis move for a step [s] (`TableWalls.move`)."""
        self._walls.move(_ONE, tuple(part[None] for part in held), timestep)

    def resume(self, other: "TableLook") -> None:
        """Take over where the same colon has moved to in another scene."""
        self._walls.resume(other._walls)

    @property
    def displacement(self) -> AxisDisplacement | None:
        """Where its axis is, to be written to; None where it is fixed in space."""
        return self._walls.displacement

    def begin(self, arcs: Float[np.ndarray, " spheres"]) -> None:
        """Look near these arc lengths along the colon [m], which is at rest."""
        self._walls.begin(_ONE, self._colon, arcs[None])

    def arcs(self, data: mujoco.MjData | None) -> Float[np.ndarray, " spheres"]:
        """Arc length of each sphere [m]."""
        return self._looked(data).arcs[0]

    def depth(self, data: mujoco.MjData | None) -> Float[np.ndarray, " spheres"]:
        """How deep each sphere is in the wall [m]; negative for room."""
        return self._looked(data).depth[0] + self._shift

    def _looked(self, data: mujoco.MjData | None) -> TableWalls:
        if data is not None:
            self._walls.look(_ONE, data.geom_xpos[self.spheres][None])
        return self._walls


class TableWall:
    """The wall of one compiled scene that MuJoCo steps, in the colon's own coordinates."""

    def __init__(
        self,
        model: mujoco.MjModel,
        table: LumenTable,
        contact: WallContact,
        *,
        arcs: Float[np.ndarray, " spheres"],
        prefix: str = "wall/",
    ) -> None:
        """Find spheres and planes; `arcs` says where along the colon each sphere is at the start [m]."""
        count = len(arcs)
        self._model, self._contact, self._tree = model, contact, contact_solver.Tree.of(model)
        self.spheres = np.array([model.geom(f"{prefix}sphere_{i:04d}").id for i in range(count)])
        self._inverse_inertia = model.body_invweight0[model.geom_bodyid[self.spheres], 0]
        names = [f"{prefix}plane_{i:04d}_0" for i in range(count)]
        self._geoms = np.array([model.geom(name).id for name in names])
        self._pairs = np.array([model.pair(name).id for name in names])
        self._mocap = np.array([model.body_mocapid[model.body(name).id] for name in names])
        self._sphere_of = np.full(model.ngeom, -1)
        self._sphere_of[self.spheres] = np.arange(count)
        self._walls = TableWalls(stack([table.tables]), 1, count, radius=table.device_radius, threaded=True)
        self._surface = _FIXED
        if self._walls.displacement is not None:
            model.flg_surfacevel = True
            self._surface = model.geom_surfacevel[None]
        self._ahead = np.array([contact.damping / contact.stiffness + model.opt.timestep])
        self._elasticity, self._stiffens = ELASTICITIES[contact.elasticity], contact.elasticity != LINEAR
        self._firm = np.zeros((1, count))
        self._force, self._damping = np.zeros((1, count, 3)), np.zeros((1, count, 2))
        self._loads = LinkLoads(model, self.spheres)
        contact_solver.step(model, mujoco.MjData(model), self._tree, loops().solve)  # compiled before it is timed
        self.begin(arcs)

    @property
    def arcs(self) -> Float[np.ndarray, " spheres"]:
        """Arc length of each sphere [m]."""
        return self._walls.arcs[0]

    @property
    def displacement(self) -> Float[np.ndarray, "nodes 7"] | None:
        """Poses of the nodes of the colon's axis (`AxisDisplacement`); None where it is fixed in space."""
        return None if self._walls.displacement is None else self._walls.displacement.pose[0]

    @property
    def table(self) -> Float[np.ndarray, "stations angles 4"]:
        """The wall that spheres are looked up in, to be written to (`Tables.wall`)."""
        return self._walls.table

    def lose_pressure(self, lost: float) -> None:
        """Let gas thrust the colon's ends apart by so much less than when it was imaged, over its area then [Pa]."""
        self._walls.lose_pressure(np.array([lost]))

    def weigh(self, more: Float[np.ndarray, "nodes 3"]) -> None:
        """Let so much weigh on the nodes of the colon's axis besides what its mesentery says [N]."""
        self._walls.weigh(more[None])

    def set_stiffness(self, stiffness: float) -> None:
        """Give the wall another normal stiffness [N/m]; its damping keeps its ratio to it."""
        ratio = self._contact.damping / self._contact.stiffness
        self._contact = replace(self._contact, stiffness=stiffness, damping=ratio * stiffness)
        model, pairs = self._model, self._pairs
        law = contact_parameters(
            self._inverse_inertia, self._contact, timestep=model.opt.timestep, where="the wall under gas"
        )
        model.pair_solref[pairs], model.pair_solreffriction[pairs] = law.solref, law.sliding
        model.pair_solimp[pairs, :2] = law.impedance[:, None]

    def begin(self, arcs: Float[np.ndarray, " spheres"]) -> None:
        """Look for every sphere anew, near these arc lengths along the colon [m], which is at rest."""
        self._walls.begin(_ONE, _ONE, arcs[None])

    def resume(self, other: "TableWall") -> None:
        """Take over where the same colon has moved to in another scene."""
        self._walls.resume(other._walls)

    def update(self, data: mujoco.MjData) -> None:
        """Put the planes where the wall is now next to their spheres; to be called before every step."""
        model = self._model
        mujoco.mj_kinematics(model, data)
        walls, points = self._walls, data.geom_xpos[self.spheres][None]
        walls.look(_ONE, points)
        self._loads.put(data, walls.thread(_ONE, points))
        if self._contact.friction_rise:
            self._rub(data)
        depth, self._firm = self._elasticity(np, walls.depth, np.full_like(walls.depth, self._contact.stiffness))
        loops().place_planes(
            _ONE,
            points,
            depth,
            walls.inwards,
            walls.wall_speed,
            float(model.geom_size[self.spheres[0], 0]),
            self._firm,
            self._stiffens,
            self._ahead,
            self._inverse_inertia,
            model.opt.timestep,
            self._mocap,
            self._geoms,
            self._pairs,
            data.mocap_pos[None],
            data.mocap_quat[None],
            model.pair_margin[None],
            model.pair_solref[None],
            model.pair_solreffriction[None],
            model.pair_solimp[None],
            self._surface,
        )

    def energy(self) -> float:
        """Energy stored in the wall where its planes were put last [J]."""
        depth = np.maximum(self._walls.depth[0], 0.0)
        return float(stored_energy(self._contact.elasticity, depth, self._contact.stiffness).sum())

    def _rub(self, data: mujoco.MjData) -> None:
        """Let friction rise with the speed at which the spheres' surfaces slide on the wall."""
        model, walls, law = self._model, self._walls, self._contact
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        bodies, inwards = model.geom_bodyid[self.spheres], walls.inwards[0]
        surface = data.geom_xpos[self.spheres] - model.geom_size[self.spheres, :1] * inwards
        turning, moving = data.cvel[bodies, :3], data.cvel[bodies, 3:]
        speed = moving + np.cross(turning, surface - data.subtree_com[model.body_rootid[bodies]]) - walls.wall_speed[0]
        across = speed - np.einsum("si,si->s", speed, inwards)[:, None] * inwards
        friction = law.friction + law.friction_rise * np.linalg.norm(across, axis=1)
        model.pair_friction[self._pairs, :2] = friction[:, None]

    def step(self, data: mujoco.MjData) -> None:
        """Advance by one step, the colon's too."""
        contact_solver.step(self._model, data, self._tree, loops().solve)
        if self._walls.displacement is not None:
            self._step_axis(data)

    def _step_axis(self, data: mujoco.MjData) -> None:
        """Let the colon move under the contacts of the step that was made."""
        contact, law = data.contact, self._contact
        loops().contacts(
            self._sphere_of,
            contact.geom,
            contact.frame,
            contact.efc_address,
            data.efc_force,
            data.efc_vel,
            law.rubs,
            self._firm[0] * self._ahead,
            SLIP_SPEED,
            self._force,
            self._damping,
        )
        self._walls.step_axis(_ONE, self._force, self._damping, self._model.opt.timestep)
