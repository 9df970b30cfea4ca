"""Walls of convex pieces in a scene that MuJoCo steps: what presses on one place counts once, and moves the colon.

The scope meets the pieces with spheres. A sphere touches several pieces where they join, and MuJoCo gives each of them
the wall's stiffness; only the piece in which it is deepest counts here, so that its force is K d. In a colon on its
mesentery the pieces of each block stand on a mocap body that goes along with the axis at the middle of the block.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from haustra.models.wall import lumen_table, moving_colon
from haustra.models.wall.compiled import loops
from haustra.models.wall.law import WallContact, apply_contact
from haustra.models.wall.moving_colon import AxisDisplacement, AxisShape
from haustra.models.wall.pieces.wall import Wall
from haustra.models.wall.planes import Sample, add_sphere
from haustra.models.wall.table_wall import SLIP_SPEED, TableLook

_ONE = np.zeros(1, int)
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


def step_once(model: mujoco.MjModel, data: mujoco.MjData, spheres: Bool[np.ndarray, " geoms"]) -> None:
    """Advance by one step, in which what these spheres press at one place counts once.

    Of the pieces that a sphere touches the one in which it is deepest counts, and of those that stand in front of the
    plane that touches it there, as the other side of a valley does, again the deepest. Where none is left out it is
    `mj_step`, to the bit. Contacts that do not count keep their place among `data.contact`, marked as excluded.
    """
    mujoco.mj_step1(model, data)
    if _leave_out(model, data, spheres):
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
    ) -> None:
        """Find spheres and blocks.

        Args:
            model: the compiled scene.
            contact: the law of the wall.
            look: says where along the colon its spheres are, and where its axis is if it moves.
            blocks: what pieces stand on in a colon that moves.
        """
        self._model, self._ahead = model, contact.damping / contact.stiffness + model.opt.timestep
        self.spheres, self._look = look.spheres, look
        self._sphere_of = np.full(model.ngeom, -1)
        self._sphere_of[self.spheres] = np.arange(len(self.spheres))
        self.stiffness: Float[np.ndarray, " spheres"] = np.full(len(self.spheres), contact.stiffness)
        """Stiffness of the contacts of each sphere [N/m]."""
        self._seen: mujoco.MjData | None = None
        self._rubbed = np.zeros(0, int)
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
        if self._moved is not None and other._moved is not None:
            self._moved.pose[:], self._moved.speed[:] = other._moved.pose, other._moved.speed

    def update(self, data: mujoco.MjData) -> None:
        """Put the blocks where the colon is now; to be called before every step.

        MuJoCo takes mocap bodies for ones that stand still. The wall's speed v changes the force of spring and damper,
        K d + (c + h K) d', as if it were (c / K + h) v further on, so that is where the blocks are put; across, their
        surfaces move at the speed that friction sees.
        """
        if self._moved is None:
            return
        ahead = moving_colon.carried_on(np, self._own, self._moved, self._ahead)
        both = np.concatenate([self._moved.pose, ahead])
        shape = moving_colon.shape_of(np, self._own, both)
        self._shape = AxisShape(*(part[:1] for part in shape))
        points, arcs = (np.repeat(part[None], 2, axis=0) for part in (self._blocks.places, self._blocks.arcs))
        poses, turns = moving_colon.section_poses(np, self._axis, both, shape, points, arcs)
        data.mocap_pos[self._mocap], data.mocap_quat[self._mocap] = poses[1], turns[1]
        # Speeds are needed of pieces that are touched: of those that were in the last step.
        self._model.geom_surfacevel[self._rubbed] = 0.0
        pieces = data.contact.geom[:, 1]
        pieces = np.unique(pieces[self._block_of[pieces] >= 0])
        block = self._block_of[pieces]
        now, ahead = (_matrices(turn[block]) for turn in turns)
        moved = np.einsum("gij,gj->gi", ahead - now, self._faces[pieces]) + (poses[1] - poses[0])[block]
        local = np.einsum("gji,gj->gi", ahead, moved / self._ahead)
        self._model.geom_surfacevel[pieces, :3] = np.einsum("gji,gj->gi", self._frames[pieces], local)
        self._rubbed = pieces

    def step(self, data: mujoco.MjData) -> None:
        """Advance by one step, the colon's too."""
        step_once(self._model, data, self._sphere_of >= 0)
        self._seen = data
        if self._moved is not None:
            self._give_way(data, self._moved)

    def _give_way(self, data: mujoco.MjData, moved: AxisDisplacement) -> None:
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
        loops().step_axis(self._own, _ONE, *moved, self._shape, arcs[None], lever[None], force[None], damping[None], h)

    def _find_blocks(self) -> None:
        model, blocks = self._model, self._blocks
        bodies = np.array([model.body(f"{BLOCK}{number:03d}").id for number in range(len(blocks.arcs))])
        self._mocap = model.body_mocapid[bodies]
        block_of_body = np.full(model.nbody, -1)
        block_of_body[bodies] = np.arange(len(bodies))
        self._block_of = block_of_body[model.geom_bodyid]
        self._frames, self._faces = np.zeros((model.ngeom, 3, 3)), np.zeros((model.ngeom, 3))
        for geom in map(int, np.flatnonzero(self._block_of >= 0)):
            mujoco.mju_quat2Mat(self._frames[geom].reshape(9), model.geom_quat[geom])
            self._faces[geom] = _nearest_corner(model, geom, self._frames[geom])
        self._levers = blocks.places - lumen_table.axis_at(np, self._axis, blocks.arcs[None])[0]
        model.flg_surfacevel = True


def _nearest_corner(model: mujoco.MjModel, geom: int, frame: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3"]:
    """The corner of a piece that is nearest to its block's place on the axis, seen from there [m]."""
    mesh = model.geom_dataid[geom]
    start = model.mesh_vertadr[mesh]
    corners = model.mesh_vert[start : start + model.mesh_vertnum[mesh]] @ frame.T + model.geom_pos[geom]
    return corners[np.einsum("ci,ci->c", corners, corners).argmin()]


def _matrices(quaternions: Float[np.ndarray, "turns 4"]) -> Float[np.ndarray, "turns 3 3"]:
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)
