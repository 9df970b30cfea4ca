"""Walls of convex pieces in a scene that MuJoCo steps: what presses on one place counts once, and moves the colon.

The scope meets the pieces with spheres. A sphere touches several pieces where they join, and MuJoCo gives each of them
the wall's stiffness; only the piece in which it is deepest counts here, so that its force is K d. In a colon on its
mesentery the pieces of each block stand on a mocap body that goes along with the axis at the middle of the block.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from haustra.models.wall import lumen_table, moving_colon, vectors
from haustra.models.wall.law import WallContact, apply_contact, soft_contact
from haustra.models.wall.pieces.wall import Wall
from haustra.models.wall.plane_pose import moving_contact
from haustra.models.wall.planes import Sample, add_sphere
from haustra.models.wall.table_wall import SLIP_SPEED, TableLook

"""Number of the only world."""

BLOCK = "wall/block_"
"""Names of the bodies of blocks begin so."""

BUMPS = 0.6
"""A sphere of a scope rests on what stands furthest in of the pieces about it, and so meets them sooner than the lumen
surface by this share of their root mean square error: 0.57 in a wall by CoACD (1.5 mm), 0.64 in one of prisms (0.8 mm),
over 4,000 places each (docs/decisions/wall.md). Its radius is less by that."""

SAME_PLACE, LEAST_SHARE = 0.5, 0.25
"""A piece is another wall than the one in which a sphere is deepest, and not that one's continuation, where its nearest
point is less than half as far from the sphere's middle, along the normal of the deepest, as the deepest itself; that
counts as a quarter of the radius at least. Half: as tangent planes tell two walls (`planes.SAME_SIDE`); a quarter:
engineering choice, so that what is pressed to its middle is still held by walls across."""


@dataclass(frozen=True)
class Blocks:
    """Mocap bodies that hold the pieces of a colon that moves, in the order of the scene."""

    places: Float[np.ndarray, "blocks 3"]
    """Where they stand while the colon is at rest: on the axis, in the middle of the block [m]."""
    arcs: Float[np.ndarray, " blocks"]
    """Arc lengths there [m]."""


NO_BLOCKS = Blocks(np.zeros((0, 3)), np.zeros(0))


def add_piece_spheres(
    spec: mujoco.MjSpec, samples: Sequence[Sample], contact: WallContact, wall: Wall, *, timestep: float
) -> None:
    """Add the spheres that touch a wall's pieces; the device's own geoms touch nothing.

    Args:
        spec: the scene that holds the links; compiled here, so the pieces had better come later.
        samples: the spheres.
        contact: the law of every contact.
        wall: what they are to touch.
        timestep: the time step it is integrated with [s].
    """
    nearer = BUMPS * wall.error.rms_mm * 1e-3
    names = [add_sphere(spec, i, replace(each, radius=each.radius - nearer)) for i, each in enumerate(samples)]
    bare = spec.compile()
    for name, sample in zip(names, samples, strict=True):
        spec.geom(name).conaffinity = 1
        apply_contact(spec, bare, [name], sample.law(contact), timestep=timestep)


def step_once(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    spheres: Bool[np.ndarray, " geoms"],
    *,
    amend: Callable[[mujoco.MjData], bool] = lambda data: False,
) -> None:
    """Advance by one step, in which what these spheres press at one place counts once.

    Of the pieces that a sphere touches the one in which it is deepest counts, and of those that stand in front of the
    plane that touches it there, as the other side of a valley does, again the deepest. Where none is left out it is
    `mj_step`, to the bit. Contacts that do not count keep their place among `data.contact`, marked as excluded. Those
    that do, `amend` may change before MuJoCo makes constraints of them; it says whether it did.
    """
    mujoco.mj_step1(model, data)
    fewer = _leave_out(model, data, spheres)
    if amend(data) or fewer:
        mujoco.mj_makeConstraint(model, data)
        mujoco.mj_island(model, data)
        mujoco.mj_projectConstraint(model, data)
        mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_step2(model, data)


def _leave_out(model: mujoco.MjModel, data: mujoco.MjData, spheres: np.ndarray) -> bool:
    """Exclude contacts of spheres that do not count; whether there were any."""
    contact = data.contact
    sphere = contact.geom[:, 0]  # MuJoCo names a sphere before a mesh
    if len(sphere) < 2:
        return False
    order = np.lexsort((contact.dist, sphere))
    order = order[spheres[sphere[order]]]
    touching = sphere[order]
    new = np.append(True, touching[1:] != touching[:-1])[: len(order)]
    if new.all():
        return False
    first = np.flatnonzero(new)[np.cumsum(new) - 1]
    radius, normals = model.geom_size[touching, 0], contact.frame[order, :3]
    away = radius + contact.dist[order]
    height = away * np.einsum("ci,ci->c", normals, normals[first])
    front = ~new & (height < SAME_PLACE * np.maximum(away[first], LEAST_SHARE * radius))
    other = np.flatnonzero(front)
    again = touching[other][1:] == touching[other][:-1]
    front[other[1:][again]] = False
    out = order[~new & ~front]
    contact.exclude[out] = 1
    contact.efc_address[out] = -1
    return len(out) > 0


class PieceWall:
    """The pieces of one compiled scene, and the axis on which they move."""

    def __init__(
        self,
        model: mujoco.MjModel,
        contact: WallContact,
        look: TableLook,
        *,
        blocks: Blocks = NO_BLOCKS,
        threaded: bool = False,
    ) -> None:
        """Find spheres and blocks.

        Args:
            model: the compiled scene.
            contact: the law of the wall.
            look: says where along the colon its spheres are, and where its axis is if it moves.
            blocks: what pieces stand on in a colon that moves.
            threaded: whether the spheres follow each other on a shaft, from its end to its tip, which a colon that
                moves draws on between them too (`haustra.models.wall.threads`).
        """
        self._threaded = threaded
        self._model, self._ahead = model, contact.damping / contact.stiffness + model.opt.timestep
        self.spheres, self._look = look.spheres, look
        self._sphere_of = np.full(model.ngeom, -1)
        self._sphere_of[self.spheres] = np.arange(len(self.spheres))
        self.stiffness: Float[np.ndarray, " spheres"] = np.full(len(self.spheres), contact.stiffness)
        """Stiffness of the contacts of each sphere [N/m]."""
        self._seen: mujoco.MjData | None = None
        self._moved, self._blocks, self._axis = look.displacement, blocks, look.axis
        if self._axis.mesentery is not None:
            self._own = self._axis.mesentery
            self._find_blocks()

    @property
    def displacement(self) -> Float[np.ndarray, "nodes 7"] | None:
        """Poses of the nodes of the colon's axis; None where it is fixed in space."""
        return None if self._moved is None else self._moved.pose[0]

    def begin(self, arcs: Float[np.ndarray, " spheres"]) -> None:
        """Begin with the colon at rest, spheres near these arc lengths [m]."""
        self._look.begin(arcs)
        self._seen = None

    @property
    def arcs(self) -> Float[np.ndarray, " spheres"]:
        """Arc length of each sphere [m], by the table."""
        return self._look.arcs(self._seen)

    def resume(self, other: "PieceWall") -> None:
        """Take over where the same colon has moved to in another scene."""
        self._look.resume(other._look)

    def update(self, data: mujoco.MjData) -> None:
        """Put the blocks where the colon is now; to be called before every step."""
        if self._moved is None:
            return
        ahead = moving_colon.carried_on(np, self._own, self._moved, self._ahead)
        both = np.concatenate([self._moved.pose, ahead])
        shape = moving_colon.shape_of(np, self._own, both)
        points, arcs = (np.repeat(part[None], 2, axis=0) for part in (self._blocks.places, self._blocks.arcs))
        self._poses, self._turns = moving_colon.section_poses(np, self._axis, both, shape, points, arcs)
        data.mocap_pos[self._mocap], data.mocap_quat[self._mocap] = self._poses[0], self._turns[0]
        if self._threaded:
            mujoco.mj_kinematics(self._model, data)
            self._look.thread(data)

    def _take_along(self, data: mujoco.MjData) -> bool:
        """Let contacts know how fast their blocks move: MuJoCo takes mocap bodies for ones that stand still.

        Along the normal by the law of the table's planes (`plane_pose.moving_contact`), across by surfaces that move.
        """
        if self._moved is None:
            return False
        contact, model, h = data.contact, self._model, self._model.opt.timestep
        on = np.flatnonzero((contact.exclude == 0) & (self._block_of[contact.geom[:, 1]] >= 0))
        if not len(on):
            return False
        sphere, piece = self._sphere_of[contact.geom[on, 0]], contact.geom[on, 1]
        block, inwards = self._block_of[piece], -contact.frame[on, :3]
        now, later = (_matrices(turn[block]) for turn in self._turns)
        place = np.einsum("cji,cj->ci", now, contact.pos[on] - self._poses[0, block])
        moved = np.einsum("cij,cj->ci", later - now, place) + (self._poses[1] - self._poses[0])[block]
        speed, stiffness = moved / self._ahead, self.stiffness[sphere]
        both = vectors.of(inwards), vectors.of(speed)
        depth, ahead = moving_contact(np, -contact.dist[on], *both, self._ahead, h)
        soft = soft_contact(np, self._inverse_inertia[sphere], stiffness, stiffness * ahead, timestep=h)
        contact.dist[on], contact.solref[on], contact.solimp[on, :2] = -depth, soft.solref, soft.impedance[:, None]
        local = np.einsum("cji,cj->ci", now, speed)
        model.geom_surfacevel[piece, :3] = np.einsum("cji,cj->ci", self._frames[piece], local)
        return True

    def step(self, data: mujoco.MjData) -> None:
        """Advance by one step, the colon's too."""
        step_once(self._model, data, self._sphere_of >= 0, amend=self._take_along)
        self._seen = data
        if self._moved is not None:
            self._step_axis(data)

    def _step_axis(self, data: mujoco.MjData) -> None:
        """Let the colon move under the contacts of the step that was made."""
        contact, h = data.contact, self._model.opt.timestep
        rows, block = contact.efc_address, self._block_of[contact.geom[:, 1]]
        on = np.flatnonzero((rows >= 0) & (block >= 0))
        on = on[data.efc_force[rows[on]] > 0]
        rows, block = rows[on], block[on]
        frames = contact.frame[on].reshape(-1, 3, 3)
        across = rows[:, None] + np.arange(self._model.geom_condim[self.spheres[0]])
        force = np.einsum("ca,cai->ci", data.efc_force[across], frames[:, : across.shape[1]])
        damping = np.zeros((len(on), 2))
        damping[:, 0] = self._ahead * self.stiffness[self._sphere_of[contact.geom[on, 0]]]
        if across.shape[1] > 1:
            drag, slip = (np.hypot(*part[across[:, 1:]].T) for part in (data.efc_force, data.efc_vel))
            damping[:, 1] = drag / np.maximum(slip, SLIP_SPEED)
        turned = _matrices(data.mocap_quat[self._mocap[block]])
        lever = np.einsum("cji,cj->ci", turned, contact.pos[on] - data.mocap_pos[self._mocap[block]])
        lever += self._levers[block]
        arcs = self._blocks.arcs[block]
        self._look.move((arcs, lever, force, damping), h)

    def _find_blocks(self) -> None:
        model, blocks = self._model, self._blocks
        bodies = np.array([model.body(f"{BLOCK}{number:03d}").id for number in range(len(blocks.arcs))])
        self._mocap = model.body_mocapid[bodies]
        block_of_body = np.full(model.nbody, -1)
        block_of_body[bodies] = np.arange(len(bodies))
        self._block_of = block_of_body[model.geom_bodyid]
        self._frames = np.zeros((model.ngeom, 3, 3))
        for geom in map(int, np.flatnonzero(self._block_of >= 0)):
            mujoco.mju_quat2Mat(self._frames[geom].reshape(9), model.geom_quat[geom])
        self._inverse_inertia = model.body_invweight0[model.geom_bodyid[self.spheres], 0]
        self._levers = blocks.places - lumen_table.axis_at(np, self._axis, blocks.arcs[None])[0]
        model.flg_surfacevel = True


def _matrices(quaternions: Float[np.ndarray, "turns 4"]) -> Float[np.ndarray, "turns 3 3"]:
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
