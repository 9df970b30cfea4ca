"""Tangent planes in a colon that moves: the lumen surface where it lies now, and the axis that gives way to contacts.

Places are taken back into the colon at rest, where the nearest triangle is looked for; its nearest place is then taken
to where the colon is now, so that planes touch the surface that is drawn and saved. Planes tell MuJoCo how fast the
wall moves, as those of the table do (`haustra.models.wall.plane_pose.moving_planes`).
"""

from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation

from haustra.models.anatomy.colon import Colon
from haustra.models.wall import lumen_table, moving_colon
from haustra.models.wall.compiled import loops
from haustra.models.wall.law import SLIP_SPEED, WallContact, soft_contact
from haustra.models.wall.mesentery import Mesentery
from haustra.models.wall.plane_pose import moving_planes, plane_pose
from haustra.models.wall.planes import PLANES, PlaneWall
from haustra.models.wall.signed_distance import CANDIDATES, ON_SURFACE, ClosestPoints, LumenDistance
from haustra.models.wall.table_wall import TableLook

_WITH_FRICTION = 3
"""Rows of MuJoCo's constraint of a contact with friction."""


class MovedLumen:
    """Signed distance from the lumen surface of a colon that has moved; `follow` says that it has.

    Its methods are those of `LumenDistance`, in places where the colon is now.
    """

    def __init__(self, colon: Colon, look: TableLook) -> None:
        """Take a colon as it is at rest, and what knows where its axis is."""
        self._rest = LumenDistance(colon, by_sections=True)
        self.anus, self.inwards = self._rest.anus, self._rest.inwards
        assert look.displacement is not None and look.axis.mesentery is not None
        self._tables, self._displacement = look.axis, look.displacement
        self._own: Mesentery = look.axis.mesentery
        self.follow()

    def follow(self, ahead: float = 0.0) -> None:
        """Lie where the axis is now, and know where it will be after a short time at its speed [s]."""
        later = moving_colon.carried_on(np, self._own, self._displacement, ahead)
        self._poses = self._displacement.pose.copy(), later
        self._shapes = [moving_colon.shape_of(np, self._own, pose) for pose in self._poses]

    def candidates(
        self, points: Float[np.ndarray, "points 3"], arcs: Float[np.ndarray, " points"], *, count: int = CANDIDATES
    ) -> Int[np.ndarray, "points candidates"]:
        """Triangles that may be nearest to points [m] near those arc lengths [m]."""
        return self._rest.candidates(self.at_rest(points, arcs), arcs, count=count)

    def nearest_of(
        self, points: Float[np.ndarray, "points 3"], candidates: Int[np.ndarray, "points candidates"]
    ) -> ClosestPoints:
        """The nearest place of some triangles to each point [m], both where they are now.

        A point is taken back by the section of the nearest centre, then by that of the foot which this gave.
        """
        found = self._rest.nearest_of(self.at_rest(points, self._rest.triangle_arcs[candidates[:, 0]]), candidates)
        found = self._rest.nearest_of(self.at_rest(points, found.arcs), candidates)
        arcs = found.arcs
        feet, normals = self._moved(found.points, arcs), self._turned(found.normals, arcs)
        apart = points - feet
        distance = np.linalg.norm(apart, axis=1)
        sign = np.where(np.einsum("pi,pi->p", apart, normals) < 0, 1.0, -1.0)
        inwards = (-sign / np.maximum(distance, 1e-12))[:, None] * apart
        on = distance < ON_SURFACE
        inwards[on] = normals[on] / np.linalg.norm(normals[on], axis=1)[:, None]
        return ClosestPoints(feet, inwards, normals, sign * distance, arcs)

    def edge(
        self, point: Float[np.ndarray, " 3"], up: Float[np.ndarray, " 3"], near: Int[np.ndarray, " triangles"]
    ) -> float:
        """How far a point [m] between the sides of a fold lies below its edge along `up`; negative above it [m]."""
        arcs = self.nearest_of(point[None], near[None]).arcs
        at_rest, upwards = self.at_rest(point[None], arcs), self._turned(up[None], arcs, back=True)
        return self._rest.edge(at_rest[0], upwards[0], near)

    def middle(self, arc: float) -> Float[np.ndarray, " 3"]:
        """The centreline at an arc length [m]."""
        return moving_colon.axis_at(np, self._tables, self._poses[0], np.array([[arc]]))[0, 0]

    def clear(
        self, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], arcs: Float[np.ndarray, " 2"]
    ) -> bool:
        """Whether the straight line between two places [m] at those arc lengths [m] meets no wall."""
        one, other = self.at_rest(np.array([start, end]), arcs)
        return self._rest.clear(one, other, arcs)

    def at_rest(
        self, points: Float[np.ndarray, "points 3"], arcs: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "points 3"]:
        """Where places at those arc lengths would be, had the colon not moved [m]."""
        return moving_colon.to_reference(np, self._tables, self._poses[0], self._shapes[0], points[None], arcs[None])[0]

    def speed(
        self, at_rest: Float[np.ndarray, "points 3"], arcs: Float[np.ndarray, " points"], ahead: float
    ) -> Float[np.ndarray, "points 3"]:
        """How fast places of the colon at rest [m] move [m/s], by where they will be after the time of `follow` [s]."""
        return (self._moved(at_rest, arcs, later=True) - self._moved(at_rest, arcs)) / ahead

    def lever(
        self, at_rest: Float[np.ndarray, "points 3"], arcs: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "points 3"]:
        """From the axis at rest to places of the colon at rest [m]."""
        return at_rest - lumen_table.axis_at(np, self._tables, arcs[None])[0]

    def _moved(self, at_rest: np.ndarray, arcs: np.ndarray, *, later: bool = False) -> Float[np.ndarray, "points 3"]:
        return self._sections(at_rest, arcs, later=later)[0][0]

    def _turned(self, vectors: np.ndarray, arcs: np.ndarray, *, back: bool = False) -> Float[np.ndarray, "points 3"]:
        turns = self._sections(vectors, arcs, later=False)[1][0]
        return Rotation.from_quat(turns, scalar_first=True).apply(vectors, inverse=back)

    def _sections(self, places: np.ndarray, arcs: np.ndarray, *, later: bool) -> tuple[Any, Any]:
        which = int(later)
        pose, shape = self._poses[which], self._shapes[which]
        return moving_colon.section_poses(np, self._tables, pose, shape, places[None], arcs[None])


class MovingPlaneWall(PlaneWall):
    """Moves the planes of one compiled scene, and lets the colon give way to what presses on them."""

    def __init__(
        self,
        model: mujoco.MjModel,
        lumen: MovedLumen,
        look: TableLook,
        contact: WallContact,
        *,
        arcs: Float[np.ndarray, " spheres"],
        threaded: bool = False,
    ) -> None:
        """Find spheres and planes.

        Args:
            model: the compiled scene.
            lumen: the colon's surface.
            look: where its axis is, the same as the lumen's.
            contact: the law of the wall.
            arcs: where along the colon each sphere is at the start [m].
            threaded: whether the spheres follow each other on a shaft, from its end to its tip, which the colon draws
                on between them too (`haustra.models.wall.threads`).
        """
        count = len(arcs)
        self._lumen, self._look, self._threaded = lumen, look, threaded
        self._ahead = contact.damping / contact.stiffness + model.opt.timestep
        self.stiffness: Float[np.ndarray, " spheres"] = np.full(count, contact.stiffness)
        """Stiffness of the contacts of each sphere [N/m]."""
        super().__init__(model, lumen, arcs=arcs)
        self._inverse_inertia = model.body_invweight0[model.geom_bodyid[self.spheres], 0]
        names = [[f"wall/plane_{number:04d}_{side}" for side in range(PLANES)] for number in range(count)]
        self._geoms = np.array([[model.geom(name).id for name in row] for row in names])
        self._rubs = bool((model.pair_dim[self.pairs] == _WITH_FRICTION).all())
        self._slot_of = np.full(model.ngeom, -1)
        self._slot_of[self._geoms.ravel()] = np.arange(count * PLANES)
        self._force, self._damping = np.zeros((1, count * PLANES, 3)), np.zeros((1, count * PLANES, 2))
        model.flg_surfacevel = True

    @property
    def displacement(self) -> Float[np.ndarray, "nodes 7"]:
        """Poses of the nodes of the colon's axis."""
        assert self._look.displacement is not None
        return self._look.displacement.pose[0]

    def begin(self, arcs: Float[np.ndarray, " spheres"]) -> None:
        """Look for every sphere anew, near these arc lengths along the colon [m], which is at rest."""
        super().begin(arcs)
        self._look.begin(arcs)
        self._lumen.follow(self._ahead)
        self._carried, self._held_at = np.zeros((len(arcs), 3)), np.zeros((len(arcs), PLANES))
        self._levers = np.zeros((len(arcs), PLANES, 3))

    def resume(self, other: "MovingPlaneWall") -> None:
        """Take over where the same colon has moved to in another scene."""
        self._look.resume(other._look)

    def update(self, data: mujoco.MjData) -> Float[np.ndarray, " spheres"]:
        """Put the planes where their spheres are nearest to the wall as it lies now; to be called before every step."""
        self._lumen.follow(self._ahead)
        self._room[:] = 0.0  # the wall may come to a sphere that stays where it is
        self._seen += self._carried  # what touched the wall went along with it, and its triangles did
        self._asked += self._carried
        outside = super().update(data)
        if self._threaded:
            self._look.thread(data)
        return outside

    def step(self, data: mujoco.MjData) -> None:
        """Advance by one step, the colon's too."""
        super().step(data)
        contact, firm = data.contact, np.repeat(self._ahead * self.stiffness, PLANES)
        loops().contacts(
            self._slot_of,
            np.ascontiguousarray(contact.geom[:, ::-1]),  # of each contact, the plane where others have the sphere
            contact.frame,
            contact.efc_address,
            data.efc_force,
            data.efc_vel,
            self._rubs,
            firm,
            SLIP_SPEED,
            self._force,
            self._damping,
        )
        held = self._held_at.reshape(-1), self._levers.reshape(-1, 3), self._force[0], self._damping[0]
        self._look.move(held, self._model.opt.timestep)

    def _place(
        self, data: mujoco.MjData, side: int, spheres: np.ndarray, centres: np.ndarray, depth: np.ndarray, inwards: Any
    ) -> None:
        """Put planes of spheres that are so deep in the wall [m], along its normals, which move with it."""
        model, h, arcs = self._model, self._model.opt.timestep, self.arcs[spheres]
        radius, stiffness = self._radius[spheres], self.stiffness[spheres]
        beside = np.maximum(depth, -radius) - radius  # a plane that is parked is nowhere
        at_rest = self._lumen.at_rest(centres + beside[:, None] * inwards, arcs)
        speed = self._lumen.speed(at_rest, arcs, self._ahead)
        pose = plane_pose(np, centres, radius, depth, inwards)
        margin, ahead, surface = moving_planes(np, pose, depth, inwards, speed, self._ahead, h)
        soft = soft_contact(np, self._inverse_inertia[spheres], stiffness, stiffness * ahead, timestep=h)
        planes, pairs = self._planes[spheres, side], self.pairs[spheres, side]
        data.mocap_pos[planes], data.mocap_quat[planes], model.pair_margin[pairs] = pose.position, pose.turn, margin
        model.pair_solref[pairs], model.pair_solreffriction[pairs] = soft.solref, soft.sliding
        model.pair_solimp[pairs, :2] = soft.impedance[:, None]
        model.geom_surfacevel[self._geoms[spheres, side], :3] = surface
        self._held_at[spheres, side], self._levers[spheres, side] = arcs, self._lumen.lever(at_rest, arcs)
        if side == 0:
            self._carried[spheres] = h * speed
