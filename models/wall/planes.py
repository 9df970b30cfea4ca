"""The wall as tangent planes: each place of a device meets the lumen surface where it is nearest, at any depth.

A device is sampled by spheres along its links. Beside every sphere stand two planes, touching the lumen surface at the
foot of the sphere's centre, and at that of the centre moved off the first by one radius, which finds the opposite wall
of a valley or of a lumen that is too narrow. A plane is a half-space: it has no thickness to be pressed through, no
joints, and gives one contact a sphere. The planes follow their spheres as mocap bodies between steps, so that plain
MuJoCo does the contacts, with the law of `haustra.models.wall.law`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

import mujoco
import numpy as np
from jaxtyping import Float, Int

from haustra.models.wall.elasticity import LINEAR
from haustra.models.wall.law import (
    IMPEDANCE_RATIO,
    SLIP_RELAXATION,
    WallContact,
    contact_parameters,
    require_impedance_ratio,
    solimp,
)
from haustra.models.wall.plane_pose import plane_pose
from haustra.models.wall.signed_distance import CANDIDATES, ClosestPoints

PLANES = 2
"""Planes a sphere: one for each side of a valley."""
AWAY = 1e3
"""How far behind the wall a plane waits that nothing is to touch [m]."""
ENTRANCE = 0.05
"""A sphere before the anal end's plane is outside the patient when it was last seen no further in than this [m];
further in, it lies in a loop that passes behind."""
_FELT = sum(
    1 << int(part)
    for part in (
        mujoco.mjtConDataField.mjCONDATA_FORCE,
        mujoco.mjtConDataField.mjCONDATA_NORMAL,
        mujoco.mjtConDataField.mjCONDATA_TANGENT,
    )
)
SAME_SIDE = 0.5
"""Cosine between the normals of both planes above which the second finds nothing new and is parked."""


@dataclass(frozen=True)
class Sample:
    """A sphere on a link of a device."""

    body: str
    """Name of the link."""
    position: Float[np.ndarray, " 3"]
    """Centre, in the link's frame [m]."""
    radius: float
    """Radius [m]."""
    stiffness: float | None = None
    """Stiffness of the contact [N/m], where the device's own compliance stands for the wall's; the wall's when None."""
    friction: float | None = None
    """Coulomb's coefficient, where it is the sphere's own [1]; that between device and wall when None."""

    def law(self, wall: WallContact) -> WallContact:
        """The law of this sphere's contacts with a wall of that law."""
        own = wall if self.stiffness is None else replace(wall.stiffened(self.stiffness), elasticity=LINEAR)
        return own if self.friction is None else replace(own, friction=self.friction)


def capsule_samples(bare: mujoco.MjModel, geoms: Sequence[str], *, spacing: float) -> tuple[Sample, ...]:
    """Spheres along capsules, ends included, at most `spacing` [m] apart; one where two capsules of a chain join.

    Where capsules are shorter than that, some ends go without, so that the wall does not get stiffer, a sphere having
    one stiffness, as the chain is cut more finely.
    """
    samples = []
    lengths = [2 * bare.geom(name).size[1] for name in geoms]
    since = 0.0
    for number, name in enumerate(geoms):
        geom = bare.geom(name)
        radius, half = geom.size[0], geom.size[1]
        axis = np.zeros(9)
        mujoco.mju_quat2Mat(axis, geom.quat)
        direction = axis.reshape(3, 3)[:, 2]
        if (
            direction @ geom.pos < 0
        ):  # MuJoCo points the axis of some capsules back; the end that is kept is the far one
            direction = -direction
        since += 2 * half
        if number + 1 < len(geoms) and number > 0 and since + lengths[number + 1] <= spacing:
            continue  # the next capsule's end is near enough to the sphere before
        since = 0.0
        count = max(1, int(np.ceil(2 * half / spacing - 1e-9)))
        places = np.linspace(-half, half, count + 1)[0 if number == 0 else 1 :]
        body = bare.body(bare.geom_bodyid[geom.id]).name
        samples += [Sample(body, geom.pos + place * direction, float(radius)) for place in places]
    return tuple(samples)


def add_sphere(spec: mujoco.MjSpec, number: int, sample: Sample, *, prefix: str = "wall/") -> str:
    """Add a sphere without mass that touches what pairs say, and return its name."""
    name = f"{prefix}sphere_{number:04d}"
    spec.body(sample.body).add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        pos=sample.position,
        size=[sample.radius, 0, 0],
        mass=0,
        contype=0,
        conaffinity=0,
        group=3,
    )
    return name


def add_planes(
    spec: mujoco.MjSpec,
    bare: mujoco.MjModel,
    samples: Sequence[Sample],
    contact: WallContact,
    *,
    timestep: float,
    planes: int = PLANES,
    prefix: str = "wall/",
) -> None:
    """Add the spheres and their planes, parked, and the pairs that let each sphere touch its own planes only.

    Args:
        spec: the scene that holds the links.
        bare: the same links compiled at rest, for their inverse inertia.
        samples: the spheres.
        contact: the law of every contact.
        timestep: the time step it is integrated with [s].
        planes: planes a sphere.
        prefix: of the names.
    """
    require_impedance_ratio(spec, IMPEDANCE_RATIO / SLIP_RELAXATION)  # friction damps by their product
    for number, sample in enumerate(samples):
        sphere = add_sphere(spec, number, sample, prefix=prefix)
        inverse_inertia = bare.body_invweight0[bare.body(sample.body).id, 0]
        own = sample.law(contact)
        soft, friction = contact_parameters(inverse_inertia, own, timestep=timestep, where=sample.body), own.friction
        condim = 3 if own.rubs else 1
        for side in range(planes):
            name = f"{prefix}plane_{number:04d}_{side}"
            body = spec.worldbody.add_body(name=name, pos=[0, 0, -AWAY], mocap=True)
            body.add_geom(
                name=name,
                type=mujoco.mjtGeom.mjGEOM_PLANE,
                size=[0.01, 0.01, 0.01],
                contype=0,
                conaffinity=0,
                group=4,
                rgba=[0.85, 0.55, 0.5, 0.3],
            )
            spec.add_pair(
                name=name,
                geomname1=name,
                geomname2=sphere,
                condim=condim,
                friction=[friction, friction, 0, 0, 0],
                solref=soft.solref,
                solreffriction=soft.sliding,
                solimp=solimp(float(soft.impedance)),
            )


def add_felt(spec: mujoco.MjSpec, count: int, *, prefix: str = "wall/") -> None:
    """Let MuJoCo tell what that many spheres do to the wall: a sensor each of force, normal and tangent (`felt`)."""
    for number in range(count):
        spec.add_sensor(
            name=f"{prefix}felt_{number:04d}",
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_GEOM,
            objname=f"{prefix}sphere_{number:04d}",
            intprm=[_FELT, 2, 1],  # of the contact with the largest force, which is the only one
        )


def with_friction(model: mujoco.MjModel) -> mujoco.MjModel:
    """A model whose planes all rub, for worlds with friction of their own; without, MuJoCo's contacts never would."""
    model.pair_dim[:] = 3
    return model


WIDER = 48
"""Triangles looked at around a sphere, and around where it last touched, when the nearest is on the wrong side."""
FACING = 0.5
"""Least cosine between a normal and the way back to the wall: beside the edge of a fold it does not lie behind it."""
NEIGHBOURS = 4.0
"""Successive spheres that are nearer to each other than this many radii lie on one stiff stretch of a device."""
LEVEL = 0.1
"""Least length of the sum of two normals that says where out of a fold is; else the centreline says."""
ONSET = 0.25
"""Over this much of the cosine below `SAME_SIDE` the edge of a fold comes to bear, so that it does not strike."""
ASK_AGAIN = 1e-3
"""Once a sphere has moved this far [m], the triangles next to it are looked for anew: they are 6 mm wide."""


@runtime_checkable
class Lumen(Protocol):
    """What places planes: `haustra.models.wall.signed_distance.LumenDistance`, and that of a colon that moves."""

    anus: Float[np.ndarray, "3"]
    inwards: Float[np.ndarray, "3"]

    def candidates(
        self, points: Float[np.ndarray, "points 3"], arcs: Float[np.ndarray, " points"], *, count: int = CANDIDATES
    ) -> Int[np.ndarray, "points candidates"]:
        """Triangles that may be nearest to points [m] near those arc lengths [m]."""
        ...

    def nearest_of(
        self, points: Float[np.ndarray, "points 3"], candidates: Int[np.ndarray, "points candidates"]
    ) -> ClosestPoints:
        """The nearest place of some triangles to each point [m]."""
        ...

    def edge(
        self, point: Float[np.ndarray, " 3"], up: Float[np.ndarray, " 3"], near: Int[np.ndarray, " triangles"]
    ) -> float:
        """How far a point [m] between the sides of a fold lies below its edge, seen along `up` [m]."""
        ...

    def middle(self, arc: float) -> Float[np.ndarray, " 3"]:
        """The centreline at an arc length [m]."""
        ...

    def clear(
        self, start: Float[np.ndarray, " 3"], end: Float[np.ndarray, " 3"], arcs: Float[np.ndarray, " 2"]
    ) -> bool:
        """Whether the straight line between two places [m] at those arc lengths [m] meets no wall."""
        ...


class PlaneWall:
    """Moves the planes of one compiled scene to where their spheres are."""

    def __init__(
        self, model: mujoco.MjModel, field: Lumen, *, arcs: Float[np.ndarray, " spheres"], prefix: str = "wall/"
    ) -> None:
        """Find spheres and planes; `arcs` says where along the colon each sphere is at the start [m]."""
        self._model, self._field = model, field
        count = len(arcs)
        self.spheres = np.array([model.geom(f"{prefix}sphere_{i:04d}").id for i in range(count)])
        self.pairs = np.array(
            [[model.pair(f"{prefix}plane_{i:04d}_{side}").id for side in range(PLANES)] for i in range(count)]
        )
        self._radius = model.geom_size[self.spheres, 0]
        self._planes = np.array(
            [
                [model.body_mocapid[model.body(f"{prefix}plane_{i:04d}_{side}").id] for side in range(PLANES)]
                for i in range(count)
            ]
        )
        self.begin(arcs)

    @property
    def displacement(self) -> Float[np.ndarray, "nodes 7"] | None:
        """Poses of the nodes of the colon's axis; None: it is fixed in space."""
        return None

    def begin(self, arcs: Float[np.ndarray, " spheres"]) -> None:
        """Look for every sphere anew, near these arc lengths along the colon [m]."""
        count = len(arcs)
        self.arcs = np.array(arcs, float)
        self.outside = np.full(count, -np.inf)
        # No sphere touches before it has moved by the room it had when it was last looked at.
        self._seen, self._room = np.zeros((count, 3)), np.zeros(count)
        self._inwards, self._normals = np.zeros((count, 3)), np.zeros((count, 3))
        self._asked = np.full((PLANES, count, 3), np.inf)
        self._candidates = np.zeros((PLANES, count, CANDIDATES), int)

    def update(self, data: mujoco.MjData) -> Float[np.ndarray, " spheres"]:
        """Put the planes where their spheres are nearest to the wall.

        Returns how far each centre stands outside the lumen [m], for those away from the wall as last looked at.

        To be called before every step: a normal that lags behind the position feeds energy into a body that slides
        along a curved wall.
        """
        mujoco.mj_kinematics(self._model, data)
        centres = data.geom_xpos[self.spheres]
        along = (centres - self._field.anus) @ self._field.inwards
        before = (along < 0) & (self.arcs < ENTRANCE)
        moved = np.linalg.norm(centres - self._seen, axis=1)
        due = np.flatnonzero(~before & (moved >= self._room))
        self.arcs[before] = along[before]
        if len(due):
            first = self._follow(due, centres, moved)
            self._inwards[due], self._normals[due] = first.inwards, first.normals
            self.arcs[due], self._seen[due], self.outside[due] = first.arcs, centres[due], first.outside
            self._room[due] = np.maximum(-first.outside - self._radius[due], 0.0)
            self._place(data, 0, due, centres[due], first.outside + self._radius[due], first.inwards)
            touching = first.outside > -self._radius[due]
            at, inwards = due[touching], first.inwards[touching]
            self._place_second(data, at, centres[at], inwards)
            self._place_edges(data, at, centres[at], inwards)
        for idle in (np.flatnonzero(before), due[self._room[due] > 0] if len(due) else due):
            data.mocap_pos[self._planes[idle, 1]] = [0, 0, -AWAY]
            data.mocap_quat[self._planes[idle, 1]] = [1, 0, 0, 0]
        data.mocap_pos[self._planes[before, 0]] = [0, 0, -AWAY]
        data.mocap_quat[self._planes[before, 0]] = [1, 0, 0, 0]
        self._room[before] = 0.0
        return self.outside

    def step(self, data: mujoco.MjData) -> None:
        """Advance by one step."""
        mujoco.mj_step(self._model, data)

    def _follow(self, spheres: np.ndarray, centres: np.ndarray, moved: np.ndarray) -> ClosestPoints:
        """The wall next to those of all spheres on the side where they were before all moved so far [m]."""
        feet = self._nearest(0, spheres, centres[spheres])
        strayed = ~_same_wall(feet, self.outside[spheres], self._normals[spheres], moved[spheres])
        strayed &= np.isfinite(self.outside[spheres])
        for at in np.flatnonzero(strayed):
            sphere = int(spheres[at])
            if feet.outside[at] < 0 and self._beside(sphere, centres):
                continue
            known = self._again(sphere, centres[sphere], float(moved[sphere]))
            if known is not None:
                for whole, part in zip(vars(feet).values(), vars(known).values(), strict=True):
                    whole[at] = part[0]
        return feet

    def _beside(self, sphere: int, centres: np.ndarray) -> bool:
        """Whether no wall is between a sphere and one next to it that is in the lumen: then it is there too."""
        for other in (sphere - 1, sphere + 1):
            if 0 <= other < len(centres) and self.outside[other] < 0:
                near = np.linalg.norm(centres[other] - centres[sphere]) < NEIGHBOURS * self._radius[sphere]
                if near and self._field.clear(centres[other], centres[sphere], self.arcs[[other, sphere]]):
                    return True
        return False

    def _again(self, sphere: int, centre: np.ndarray, moved: float) -> ClosestPoints | None:
        """The nearest of the triangles round about that lie on the side where the sphere was, if there is one."""
        foot = self._seen[sphere] + self.outside[sphere] * self._inwards[sphere]
        near = self._field.candidates(np.array([centre, foot]), np.full(2, max(self.arcs[sphere], 0.0)), count=WIDER)
        near = np.unique(near)
        feet = self._field.nearest_of(np.broadcast_to(centre, (len(near), 3)), near[:, None])
        facing = (feet.inwards * feet.normals).sum(axis=1) > FACING * np.linalg.norm(feet.normals, axis=1)
        allowed = _same_wall(feet, self.outside[sphere], self._normals[sphere], moved) & (facing | (feet.outside < 0))
        allowed = np.flatnonzero(allowed)
        return feet[allowed[[np.abs(feet.outside[allowed]).argmin()]]] if len(allowed) else None

    def _nearest(self, side: int, spheres: np.ndarray, places: np.ndarray) -> ClosestPoints:
        """The wall next to those spheres' places, among triangles that are asked for now and then."""
        moved = places - self._asked[side, spheres]
        if (np.einsum("ij,ij->i", moved, moved) > ASK_AGAIN**2).any():
            # All at once: asking for one costs as much as asking for all.
            arcs = np.maximum(self.arcs[spheres], 0.0)
            self._candidates[side, spheres] = self._field.candidates(places, arcs)
            self._asked[side, spheres] = places
        return self._field.nearest_of(places, self._candidates[side, spheres])

    def _place_second(self, data: mujoco.MjData, spheres: np.ndarray, centres: np.ndarray, inwards: np.ndarray) -> None:
        """Put the second planes of spheres that touch, away from those directions."""
        if not len(spheres):
            return
        feet = self._nearest(1, spheres, centres + self._radius[spheres, None] * inwards)
        same = np.einsum("ij,ij->i", inwards, feet.inwards) > SAME_SIDE
        depth = self._radius[spheres] - np.einsum("ij,ij->i", centres - feet.points, feet.inwards)
        self._place(data, 1, spheres, centres, depth - np.where(same, AWAY, 0.0), feet.inwards)

    def _place_edges(self, data: mujoco.MjData, spheres: np.ndarray, centres: np.ndarray, inwards: np.ndarray) -> None:
        """Put the second planes of neighbours that stand astride of a fold onto its edge.

        The sides of a fold push such neighbours apart, along the device, and no longer out of the fold: a stiff device
        would sink over it, and hold it between two spheres, as deep as the fold is high.
        """
        one = np.flatnonzero(np.diff(spheres) == 1)
        if not len(one):
            return
        link = centres[one + 1] - centres[one]
        between = inwards[one] + inwards[one + 1]
        steepness = 0.5 * np.linalg.norm(between, axis=1)
        astride = (np.einsum("ij,ij->i", inwards[one], link) < 0) & (np.einsum("ij,ij->i", inwards[one + 1], link) > 0)
        astride &= (steepness < SAME_SIDE) & (np.linalg.norm(link, axis=1) < NEIGHBOURS * self._radius[spheres[one]])
        for pair in np.flatnonzero(astride):
            two = one[pair] + np.arange(2)
            middle, along = centres[two].mean(axis=0), link[pair] / np.linalg.norm(link[pair])
            up = _across(between[pair], along)
            if np.linalg.norm(up) < LEVEL:  # the sides are parallel: they do not say where the edge is
                up = _across(self._field.middle(self.arcs[spheres[two]].mean()) - middle, along)
            up /= max(float(np.linalg.norm(up)), 1e-9)
            height = self._field.edge(middle, up, self._candidates[0, spheres[two]].ravel())
            share = min((SAME_SIDE - steepness[pair]) / ONSET, 1.0)
            depth = share * (height + self._radius[spheres[two]])
            touched = depth > 0
            on, normals = two[touched], np.tile(up, (2, 1))[touched]
            self._place(data, 1, spheres[on], centres[on], depth[touched], normals)

    def _place(
        self, data: mujoco.MjData, side: int, spheres: np.ndarray, centres: np.ndarray, depth: np.ndarray, inwards: Any
    ) -> None:
        """Put the first or second planes of spheres that are so deep in the wall [m], along its normals."""
        planes, pose = self._planes[spheres, side], plane_pose(np, centres, self._radius[spheres], depth, inwards)
        data.mocap_pos[planes], data.mocap_quat[planes] = pose.position, pose.turn
        self._model.pair_margin[self.pairs[spheres, side]] = pose.margin


def _across(vector: np.ndarray, along: np.ndarray) -> np.ndarray:
    """What of a vector is at right angles to a unit vector."""
    return vector - (vector @ along) * along


def _same_wall(feet: ClosestPoints, outside: Any, normals: np.ndarray, moved: Any) -> np.ndarray:
    """Whether feet are on the side of the wall where they were: how far outside [m], with which normals, before a move.

    What moves by less than its distance from the wall does not cross it. In the lumen it is in the lumen still;
    pressed into the wall, it is pushed back to where it came from, not out at the other side of a thin fold.
    """
    crossed = ((feet.outside > 0) != (outside > 0)) & (np.abs(outside) > moved)
    turned = (feet.normals * normals).sum(axis=1) < 0
    return ~crossed & ~(turned & (outside > -moved))
