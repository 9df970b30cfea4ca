"""Walls by the lumen's table in many worlds on MuJoCo Warp, through MJX: of scopes and of any other device.

Before every step the place of each sphere is looked up in the table of its world's colon, and a plane, a mocap body, is
put there, so that MuJoCo does the contact. A colon on its mesentery gives way to what those contacts did. Looking up is
in JAX. Without a GPU the same kernels run on the CPU, slowly: for tests.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool
from mujoco import mjx

from haustra.envs.sim.state import SPEED_LIMIT
from haustra.errors import UnsupportedSceneError
from haustra.models.devices.base import Treads
from haustra.models.wall import moving_colon, threads
from haustra.models.wall.law import SLIP_SPEED, SoftContact, honoured_contact, soft_contact
from haustra.models.wall.lumen_table import Tables, WallQuery, query
from haustra.models.wall.moving_colon import AttachmentPoints, AxisDisplacement
from haustra.models.wall.plane_pose import moving_planes, plane_pose

Array = Any
_CONTACT_ROWS = 3
"""Constraint rows of a contact with friction."""


class Contacts(NamedTuple):
    """The wall's law in each world, as MuJoCo takes it."""

    stiffness: Array
    """(worlds, spheres or 1) [N/m]."""
    ahead: Array
    """(worlds, 1) c / K + h [s]."""
    model: Any
    """The model with each world's own arrays."""
    axes: Any
    """Which of its arrays have one entry a world."""


class Stepped(NamedTuple):
    """What a step left."""

    data: Any
    """MuJoCo's own."""
    arcs: Array
    """(worlds, places) arc lengths at the step's beginning [m]."""
    depth: Array
    """(worlds, spheres) how deep spheres were in the wall then [m]."""
    inwards: Array
    """(worlds, spheres, 3) normals of the wall."""
    normal: Array
    """(worlds, spheres) force of MuJoCo's contact along them [N]."""
    on_wall: Array
    """(worlds, spheres, 3) what the spheres did to the wall, friction and all [N]."""
    displacement: AxisDisplacement | None
    """Where the colons are at its end; None where they are fixed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WarpPlanes:
    """One compiled model for all worlds, with a plane for each of its spheres."""

    host: mujoco.MjModel
    """Compiled for the CPU, to make data of."""
    model: Any
    """Compiled model on the GPU for Warp, as MJX has it."""
    spheres: np.ndarray
    """(spheres,) geoms."""
    radius: np.ndarray
    """(spheres,) [m]."""
    sphere_of: np.ndarray
    """(spheres,) number of the sphere of each of the model's pairs, which it has by bodies."""
    inverse_inertia: np.ndarray
    """(spheres,) of each sphere's link, as MuJoCo's contacts see it [1/kg]."""
    moves: bool
    """Whether colons move."""
    surrounded: bool
    """Whether those have an envelope or breath around them."""
    runs: bool
    """Whether surfaces of spheres run over them, as treads do."""

    @classmethod
    def of(
        cls,
        host: mujoco.MjModel,
        count: int,
        *,
        moves: bool,
        what: str,
        surrounded: bool = False,
        runs: bool = False,
    ) -> "WarpPlanes":
        """Take a model with that many spheres.

        Args:
            host: compiled with one plane a sphere.
            count: spheres.
            moves: whether colons move.
            what: is modelled, for messages.
            surrounded: whether those have an envelope or breath around them.
            runs: whether surfaces of spheres run over them.

        Raises:
            UnsupportedSceneError: when Warp has not what the model is made of.
        """
        host = for_warp(host)
        host.flg_surfacevel = moves or runs  # walls that move, and treads, drag by friction
        host.pair_friction[:] = np.maximum(host.pair_friction, mujoco.mjMINMU)  # less may become NaN, as Warp warns
        try:
            # Room is kept for all that can happen; its solver's limits would be told on stdout at every step.
            model = mjx.put_model(host, impl="warp").tree_replace({"opt._impl.warn_overflow": 0})
        except (NotImplementedError, ValueError) as error:
            raise UnsupportedSceneError(f"The backend 'warp' cannot honour {what}: {error}") from error
        names = [f"wall/plane_{index:04d}_0" for index in range(count)]
        pairs = np.array([host.pair(name).id for name in names])
        assert sorted(pairs) == list(range(host.npair)), "one pair a sphere"
        assert [host.body(name).mocapid[0] for name in names] == list(range(host.nmocap)), "planes, in their order"
        spheres = np.array([host.geom(f"wall/sphere_{index:04d}").id for index in range(count)])
        return cls(
            host=host,
            model=model,
            spheres=spheres,
            radius=host.geom_size[spheres, 0],
            sphere_of=np.argsort(pairs),
            inverse_inertia=host.body_invweight0[host.geom_bodyid[spheres], 0],
            moves=moves,
            surrounded=surrounded,
            runs=runs,
        )

    @property
    def timestep(self) -> float:
        """Time step of all worlds [s]."""
        return float(self.host.opt.timestep)

    def check(self, stiffness: Array, damping_time: Array) -> None:
        """Refuse walls (worlds, any) that MuJoCo's contacts cannot honour.

        Raises:
            InvalidOptionError: when MuJoCo would clamp the wall's law.
        """
        stiffness = np.asarray(stiffness)
        damper = stiffness * (np.asarray(damping_time) + self.timestep)
        what = "A stiffness of the wall"
        honoured_contact(self.inverse_inertia, stiffness, damper, timestep=self.timestep, what=what)

    def contacts(
        self, stiffness: Array, damping_time: Array, friction: Array, own: Mapping[str, Array] | None = None
    ) -> Contacts:
        """The law, one row a world and one column a sphere or for all of them.

        Args:
            stiffness: [N/m].
            damping_time: of the wall (worlds or 1, 1) [s].
            friction: [1].
            own: arrays of the model that worlds have for themselves beside it, by name.
        """
        ahead, rubs = damping_time + self.timestep, jnp.maximum(friction, mujoco.mjMINMU)
        all_own = {
            "pair_friction": _with_columns(self.model.pair_friction, self._by_pair(rubs)[..., None], 2),
            **self._law(stiffness, stiffness * ahead),
            **(own or {}),
        }
        drags = self.moves or self.runs
        changing = ("pair_margin", "_impl.geom_surfacevel") if drags else ("pair_margin",)
        axes = jax.tree.map(lambda _: None, self.model).tree_replace(dict.fromkeys((*all_own, *changing), 0))
        return Contacts(stiffness, ahead, self.model.tree_replace(all_own), axes)

    def data(self, worlds: int) -> Any:
        """What MuJoCo Warp works in. Its arrays are filled on the device: as constants they would be compiled in.

        There is room for as many constraint rows as there can be, so that none is ever lost.
        """
        spheres = len(self.spheres)
        rows = _CONTACT_ROWS * spheres + int(self.host.jnt_limited.sum())
        with jax.ensure_compile_time_eval():
            one = mjx.make_data(self.host, impl="warp", naconmax=worlds * spheres, njmax=rows)
        one = jax.tree.map(_filled, one)
        return jax.vmap(lambda _: one)(jnp.arange(worlds))

    def step(
        self,
        contacts: Contacts,
        tables: Tables,
        displacement: AxisDisplacement | None,
        places: Array,
        arcs: Array,
        radius: Array,
        data: Any,
        healthy: Array,
        time: Array,
        treads: Treads | None = None,
        centres: Array | None = None,
    ) -> Stepped:
        """One time step of MuJoCo's, and of the colons.

        MuJoCo Warp solves by Newton's method in single precision. Where links are light and contacts stiff, the matrix
        that it factorises has a condition of 10^8, and now and then, by rounding alone, a root of a negative number.
        Such a step is made again by conjugate gradients, which factorise no more than the device's own inertia.

        Args:
            contacts: the law.
            tables: of one colon a world, or for each of its spheres.
            displacement: where the colons are.
            places: of the spheres, and of others whose arc lengths are asked for (worlds, places, 3) [m]; on a shaft
                those follow the spheres.
            arcs: of the places at the last look (worlds, places) [m].
            radius: of the spheres (worlds or 1, places or 1) [m].
            data: MuJoCo's, with state and controls.
            healthy: worlds that are not lost yet.
            time: of each world (worlds,) [s].
            treads: how surfaces of spheres run, of devices that have such.
            centres: centres of mass of the spheres' links (worlds, spheres, 3) [m], where these follow each other on a
                shaft, from its end to its tip, which a colon that moves draws on (`haustra.models.wall.threads`).
        """
        count, own = len(self.spheres), tables.mesentery
        found, grip = look(
            tables, displacement, places, arcs, radius, threaded=0 if centres is None else places.shape[1]
        )
        points, inwards = places[:, :count], found.inwards[:, :count]
        radius = radius[:, :count]
        depth = found.depth[:, :count] + radius - tables.device_radius
        planes = plane_pose(jnp, points, radius, depth, inwards)
        changed = {"pair_margin": self._by_pair(planes.margin)}
        speeds = jnp.zeros((len(points), self.host.ngeom, 6), points.dtype)
        if treads is not None:
            speeds = speeds.at[:, self.spheres, :3].set(treads.speed.astype(points.dtype))
            left = contacts.model.pair_friction[..., :2] * self._by_pair(treads.grip)[..., None]
            changed |= {"pair_friction": contacts.model.pair_friction.at[..., :2].set(left)}
            changed |= {"_impl.geom_surfacevel": speeds}
        if displacement and grip and own:
            grip = AttachmentPoints(grip.arcs[:, :count], grip.lever[:, :count])
            speed = moving_colon.wall_speeds(jnp, own, displacement, grip)
            ahead, h = contacts.ahead, self.timestep
            margin, damped, surface = moving_planes(jnp, planes, depth, inwards, speed, ahead, h)
            speeds = speeds.at[:, self._planes, :3].set(surface)
            changed |= {"_impl.geom_surfacevel": speeds, "pair_margin": self._by_pair(margin)}
            changed |= self._law(contacts.stiffness, contacts.stiffness * damped)
        pulled = None
        if displacement and own and centres is not None:
            pulled = threads.drawn(jnp, own, displacement.pose, points, found.arcs[:, :count])
            turning = pulled.moment + jnp.cross(points - centres, pulled.borne)
            bodies = self.host.geom_bodyid[self.spheres]
            applied = jnp.zeros((len(points), self.host.nbody, 6), data.xfrc_applied.dtype)
            borne = jnp.concatenate([pulled.borne, turning], axis=2).astype(applied.dtype)
            data = data.replace(xfrc_applied=applied.at[:, bodies].add(borne))
        model = contacts.model.tree_replace(changed)
        data = data.replace(mocap_pos=planes.position, mocap_quat=planes.turn)
        done = jax.vmap(mjx.step, in_axes=(contacts.axes, 0))(model, data)
        lost = (healthy & ~jnp.isfinite(done.qvel).all(axis=1)).any()
        slowly = model.tree_replace({"opt.solver": mjx.SolverType.CG})
        axes = contacts.axes.tree_replace({"opt.solver": mjx.SolverType.CG})
        again = lambda _: jax.vmap(mjx.step, in_axes=(axes, 0))(slowly, data)  # noqa: E731
        done = jax.lax.cond(lost, again, lambda made: made, done)
        force, damping = self._on_wall(contacts, done._impl)
        if displacement and grip and own:
            pressed, when = (grip, force, damping, self.timestep), time if self.surrounded else None
            displacement = moving_colon.step_axis(jnp, own, displacement, *pressed, time=when, drawn=pulled)
        normal = -jnp.einsum("wpi,wpi->wp", force, inwards)
        return Stepped(done, found.arcs, depth, inwards, normal, force, displacement)

    def _law(self, stiffness: Array, damper: Array) -> dict[str, Array]:
        """Arrays of the model (worlds, spheres, any) that give its contacts that law."""
        inverse = jnp.asarray(self.inverse_inertia, jnp.float32)
        soft = soft_contact(jnp, inverse, stiffness, damper, timestep=self.timestep)
        soft = SoftContact(*map(self._by_pair, soft))
        solimp = _with_columns(self.model.pair_solimp, soft.impedance[..., None], 2)
        return {"pair_solref": soft.solref, "pair_solreffriction": soft.sliding, "pair_solimp": solimp}

    def _by_pair(self, values: Array) -> Array:
        """Values of the spheres (worlds, spheres or 1, ...) in the order of the model's pairs."""
        in_order = values.shape[1] == 1 or (self.sphere_of == np.arange(len(self.sphere_of))).all()
        return values if in_order else values[:, self.sphere_of]

    def _on_wall(self, contacts: Contacts, done: Any) -> tuple[Array, Array]:
        """What MuJoCo's contacts did to the wall at each sphere, and how they damp it: [N], [N s/m].

        Sums as `haustra.models.wall.compiled` makes of one world; all worlds' contacts stand in one list.
        """
        count = len(self.spheres)
        shape = (len(contacts.stiffness), count)
        number = np.full(self.host.ngeom, count)
        number[self.spheres] = np.arange(count)
        rows, world = done.contact__efc_address[:, :_CONTACT_ROWS], done.contact__worldid
        force, slip = (part[world[:, None], rows] for part in (done.efc__force, done.efc__vel))
        there = (jnp.arange(len(world)) < done.nacon[0]) & (rows[:, 0] >= 0) & (force[:, 0] > 0)
        where = world, jnp.where(there, jnp.asarray(number)[done.contact__geom[:, 1]], count)
        drag = jnp.linalg.norm(force[:, 1:], axis=1) / jnp.maximum(jnp.linalg.norm(slip[:, 1:], axis=1), SLIP_SPEED)
        pressed = -jnp.einsum("ci,cij->cj", force, done.contact__frame)
        damper = jnp.broadcast_to(contacts.stiffness * contacts.ahead, shape)[where]
        damping = jnp.stack([damper, drag], axis=-1)
        on_wall = jnp.zeros((*shape, 3), force.dtype).at[where].add(pressed, mode="drop")
        return on_wall, jnp.zeros((*shape, 2), force.dtype).at[where].add(damping, mode="drop")

    @property
    def _planes(self) -> np.ndarray:
        """Geoms of the planes."""
        return np.array([self.host.geom(f"wall/plane_{index:04d}_0").id for index in range(len(self.spheres))])


def look(
    tables: Tables,
    displacement: AxisDisplacement | None,
    points: Array,
    arcs: Array,
    radius: Array,
    *,
    threaded: int,
) -> tuple[WallQuery, AttachmentPoints | None]:
    """Look spheres of those radii (worlds or 1, places or 1) up; and where they hold on to the colon, if it moves.

    The first so many as are `threaded` follow each other on a shaft, from its end to its tip.
    """
    if displacement is None:
        return query(jnp, tables, points, arcs), None
    return moving_colon.query(jnp, tables, displacement, points, arcs, radius, threaded=threaded)


def sound(qvel: Array, *others: Any) -> Bool[Array, " worlds"]:
    """Which worlds are of plausible speeds, and have finite numbers in other arrays, or trees of them."""
    finite = [jnp.isfinite(part).reshape(len(part), -1).all(axis=1) for part in jax.tree.leaves((qvel, *others))]
    return jnp.stack([jnp.abs(qvel).max(axis=1) < SPEED_LIMIT, *finite]).all(axis=0)


def for_warp(model: mujoco.MjModel) -> mujoco.MjModel:
    """With a solver that Warp has, and without a flag that it does not know: it never resets what diverges.

    Dense Jacobians, which scenes ask for, it takes up to 60 dofs only: it is to choose.
    """
    model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_AUTO
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return model


def _with_columns(shared: Array, values: Array, count: int) -> Array:
    """One row a world of an array that they share, its first `count` columns given."""
    rows = jnp.broadcast_to(shared, (len(values), *shared.shape))
    return rows.at[..., :count].set(values)


def _filled(part: Any) -> Any:
    """An array whose entries are all the same as one that is filled when it is needed."""
    if not isinstance(part, jax.Array) or part.size < 2:
        return part
    values = np.asarray(part)
    first = values.flat[0]
    return jnp.full(values.shape, first, values.dtype) if (values == first).all() else part
