"""Many scopes in many colons at once by MuJoCo Warp: MuJoCo's own dynamics and contacts, through MJX.

It is the native batch (`haustra.envs.sim.native_batch`) on a GPU: one plane a sphere, put before every step where the
colon's table says that the wall is. Looking up, observing and driving are those of `JaxScopes`, whose chain in JAX
this replaces by MuJoCo's. Without a GPU the same kernels run on the CPU, slowly: for tests.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

from haustra.envs.sim import chain as links
from haustra.envs.sim.capabilities import require_supported
from haustra.envs.sim.device_arrays import tree_where
from haustra.envs.sim.native_batch import batch_model
from haustra.envs.sim.precision import precise
from haustra.envs.sim.scope_values import Array, Parameters, Scope, State
from haustra.envs.sim.scope_worlds import JaxScopes, entry_gravity, look, sound_after
from haustra.envs.sim.state import Controls
from haustra.errors import UnsupportedSceneError
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.scene import Scene
from haustra.models.wall import moving_colon
from haustra.models.wall.law import SLIP_SPEED, normal_force, require_honoured, soft_contact
from haustra.models.wall.lumen_table import Tables, pick
from haustra.models.wall.moving_colon import AttachmentPoints
from haustra.models.wall.plane_pose import moving_planes, plane_pose

CONTACT_ROWS = 3
"""Constraint rows of a contact with friction."""


@dataclass(frozen=True)
class WarpScopes(JaxScopes):
    """One kind of scope on MuJoCo Warp, for any number of worlds."""

    designs_share: ClassVar[bool] = False

    host: mujoco.MjModel
    """Compiled for the CPU, to make data of."""
    model: Any
    """The same for Warp, as MJX has it."""
    inverse_inertia: np.ndarray
    """(points,) of each sphere's link, as MuJoCo's contacts see it [1/kg]."""
    locks: np.ndarray
    """(2 joints,) actuators that hold what is outside."""
    planes: np.ndarray
    """(points,) geoms of the planes."""
    sphere_of: np.ndarray
    """(geoms,) number of the sphere that each geom is; one more than the last for those that are none."""
    rows: int
    """Constraint rows kept for each world: as many as there can be, so that none is ever lost."""

    @classmethod
    def of(cls, scene: Scene) -> "WarpScopes":
        """Read a scene of wall law 'table'; its own colon does not matter.

        Raises:
            UnsupportedSceneError: when the scene has what this backend cannot honour.
        """
        require_supported(scene, "warp")
        chain = JaxScopes.of(scene)
        host = for_warp(batch_model(scene))
        host.flg_surfacevel = scene.options.mesentery  # walls that move drag by friction
        try:
            # Room is kept for all that can happen; its solver's limits would be told on stdout at every step.
            model = mjx.put_model(host, impl="warp").tree_replace({"opt._impl.warn_overflow": 0})
        except (NotImplementedError, ValueError) as error:
            raise UnsupportedSceneError(f"The backend 'warp' cannot honour this scope: {error}") from error
        planes = [f"wall/plane_{index:04d}_0" for index in range(len(scene.samples))]
        assert [host.pair(name).id for name in planes] == list(range(host.npair)), "one pair a sphere, in their order"
        assert [host.body(name).mocapid[0] for name in planes] == list(range(host.nmocap)), "so are the planes"
        spheres = [host.geom(f"wall/sphere_{index:04d}").id for index in range(len(scene.samples))]
        sphere_of = np.full(host.ngeom, len(spheres))
        sphere_of[spheres] = np.arange(len(spheres))
        return cls(
            **vars(chain),
            host=host,
            model=model,
            inverse_inertia=host.body_invweight0[host.geom_bodyid[spheres], 0],
            locks=np.array([host.actuator(name).id for pair in scene.cable.locks for name in pair]),
            planes=np.array([host.geom(name).id for name in planes]),
            sphere_of=sphere_of,
            rows=CONTACT_ROWS * len(spheres) + int(host.jnt_limited.sum()),
        )

    def parameters(
        self, scene: Scene, worlds: int, *, scope: Scope | None = None, kind: Any = jnp.float32, **changed: Any
    ) -> Parameters:
        """As of `JaxScopes`, but for one design only.

        Raises:
            InvalidOptionError: when a parameter is not known, or MuJoCo would clamp the wall's law.
            UnsupportedSceneError: when designs are given.
        """
        if scope is not None:
            raise UnsupportedSceneError("Worlds of several designs need the backend 'jax': name it.")
        parameters = super().parameters(scene, worlds, kind=kind, **changed)
        self.check(parameters)
        return parameters

    def check(self, parameters: Parameters) -> None:
        """Refuse parameters that MuJoCo's contacts cannot honour.

        Raises:
            InvalidOptionError: when MuJoCo would clamp the wall's law.
        """
        stiffness = np.asarray(parameters.stiffness)[:, None]
        damper = stiffness * (np.asarray(parameters.damping_time)[:, None] + self.timestep)
        soft = soft_contact(np, self.inverse_inertia, stiffness, damper, timestep=self.timestep)
        require_honoured(soft.impedance, what="A stiffness of the wall")

    def begin(self, parameters: Parameters, tables: Tables) -> State:
        """All scopes straight, their tips at the start depth."""
        now = super().begin(parameters, tables)
        return now._replace(warm=jnp.zeros_like(now.qvel))

    def step(self, tables: Tables, parameters: Parameters, worlds: State, hands: Controls) -> State:
        """One time step of all worlds."""
        return self.steps(tables, parameters, worlds, hands, 1)

    @precise
    def steps(self, tables: Tables, parameters: Parameters, worlds: State, hands: Controls, count: Any) -> State:
        """Several time steps under the same inputs."""
        own_tables = pick(tables, parameters.colon)
        model, axes = self._of_each(own_tables, parameters, *self._model_of(parameters))
        worlds = self.arrived(parameters, worlds, hands)
        if worlds.displacement is not None:
            axes = axes.tree_replace({"_impl.geom_surfacevel": 0})
        step = jax.vmap(mjx.step, in_axes=(axes.replace(pair_margin=0), 0))

        def one(_: Any, now: tuple[State, Any]) -> tuple[State, Any]:
            return self._step(own_tables, parameters, *now, hands, partial(self._advance, model, step))

        return jax.lax.fori_loop(0, count, one, (worlds, self._data(len(worlds.time))))[0]

    def _step(
        self, tables: Tables, parameters: Parameters, worlds: State, data: Any, hands: Controls, advance: Any
    ) -> tuple[State, Any]:
        scope, h = parameters.scope, self.timestep
        where = links.pose(self.chain, scope.links, worlds.qpos)
        points = self._samples(scope, where)
        places = jnp.concatenate([points, self._tip(scope, where)], axis=1)
        found, grip = look(tables, worlds.displacement, places, worlds.arcs, scope.radius)
        depth = found.depth[:, :-1] + scope.radius[:, None] - tables.device_radius
        inwards = found.inwards[:, :-1]
        wall_speed = jnp.zeros_like(points)
        if grip is not None and tables.mesentery is not None and worlds.displacement is not None:
            grip = AttachmentPoints(grip.arcs[:, :-1], grip.lever[:, :-1])
            wall_speed = moving_colon.wall_speeds(jnp, tables.mesentery, worlds.displacement, grip)
        planes = plane_pose(jnp, points, scope.radius[:, None], depth, inwards)
        ahead = parameters.damping_time[:, None] + h
        margin, surface = moving_planes(jnp, planes, depth, inwards, wall_speed, ahead)
        done = advance(
            margin,
            surface if worlds.displacement is not None else None,
            data.replace(
                qpos=worlds.qpos,
                qvel=worlds.qvel,
                act=worlds.hand,
                qacc_warmstart=worlds.warm,
                ctrl=self._controls(parameters, worlds, hands),
                mocap_pos=planes.position,
                mocap_quat=planes.turn,
            ),
        )
        along = jnp.einsum("wpi,wpi->wp", inwards, self._speeds(where, points, done.qvel) - wall_speed)
        stiffness = parameters.stiffness[:, None]
        displacement = worlds.displacement
        if grip is not None and tables.mesentery is not None and displacement is not None:
            pressed = self._on_wall(stiffness[:, 0] * ahead[:, 0], done._impl)
            displacement = moving_colon.step_axis(jnp, tables.mesentery, displacement, grip, *pressed, h)
        after = worlds._replace(
            qpos=done.qpos,
            qvel=done.qvel,
            hand=done.act,
            arcs=found.arcs,
            normal=normal_force(jnp, stiffness * depth, stiffness * ahead, along),
            warm=done.qacc_warmstart,
            displacement=displacement,
            time=worlds.time + h,
        )
        # MuJoCo takes what is no number for no pull.
        sound = sound_after(parameters, worlds, after) & jnp.isfinite(hands.pulls).all(axis=1)
        return tree_where(sound, after, worlds)._replace(healthy=sound), done

    def _advance(self, model: Any, step: Any, margin: Array, surface: Array | None, data: Any) -> Any:
        """MuJoCo's own step, of planes with those margins [m] whose surfaces move at those speeds [m/s]."""
        model = model.replace(pair_margin=margin)
        if surface is not None:
            speeds = jnp.zeros((len(surface), self.host.ngeom, 6), surface.dtype).at[:, self.planes, :3].set(surface)
            model = model.tree_replace({"_impl.geom_surfacevel": speeds})
        return step(model, data)

    def _on_wall(self, damper: Array, done: Any) -> tuple[Array, Array]:
        """What MuJoCo's contacts did to the wall at each sphere, and how they damp it: [N], [N s/m].

        The same sums as `haustra.models.wall.compiled` makes of one world; all worlds' contacts stand in one list.
        """
        rows, world = done.contact__efc_address[:, : self.host.pair_dim.max()], done.contact__worldid
        force, slip = (part[world[:, None], rows] for part in (done.efc__force, done.efc__vel))
        there = (jnp.arange(len(world)) < done.nacon[0]) & (rows[:, 0] >= 0) & (force[:, 0] > 0)
        where = world, jnp.where(there, jnp.asarray(self.sphere_of)[done.contact__geom[:, 1]], len(self.planes))
        drag = jnp.linalg.norm(force[:, 1:], axis=1) / jnp.maximum(jnp.linalg.norm(slip[:, 1:], axis=1), SLIP_SPEED)
        pressed = -jnp.einsum("ci,cij->cj", force, done.contact__frame[:, : rows.shape[1]])
        shape = (len(damper), len(self.planes))
        on_wall = jnp.zeros((*shape, 3), force.dtype).at[where].add(pressed, mode="drop")
        return on_wall, jnp.zeros(shape, force.dtype).at[where].add(damper[world] + drag, mode="drop")

    def _model_of(self, parameters: Parameters) -> tuple[Any, Any]:
        """The model with each world's own numbers, and which of its arrays have one entry a world."""
        model, inverse = self.model, jnp.asarray(self.inverse_inertia, jnp.float32)
        stiffness, h = parameters.stiffness[:, None], self.timestep
        damper = stiffness * (parameters.damping_time[:, None] + h)
        soft = soft_contact(jnp, inverse, stiffness, damper, timestep=h)
        scales = self._scales(parameters)
        limits = jnp.broadcast_to(model.actuator_forcerange, (len(stiffness), *model.actuator_forcerange.shape))
        push = self.host.actuator("scope/push").id
        limit = jnp.stack([-parameters.push_limit, parameters.push_limit], axis=-1)
        own = {
            "pair_friction": with_columns(model.pair_friction, parameters.friction[:, None, None], 2),
            "pair_solref": soft.solref,
            "pair_solreffriction": soft.sliding,
            "pair_solimp": with_columns(model.pair_solimp, soft.impedance[..., None], 2),
            "jnt_stiffness": scales * model.jnt_stiffness,
            "dof_damping": scales * model.dof_damping,
            "dof_armature": scales * model.dof_armature,
            "actuator_forcerange": limits.at[:, push].set(limit),
        }
        axes = jax.tree.map(lambda _: None, model)
        return model.replace(**own), axes.replace(**dict.fromkeys(own, 0))

    def _of_each(self, tables: Tables, parameters: Parameters, model: Any, axes: Any) -> tuple[Any, Any]:
        """The model with gravity and the hand's torque of each world too, and which arrays have one entry a world."""
        limit = jnp.stack([-parameters.torque_limit, parameters.torque_limit], axis=-1)
        limits = model.actuator_forcerange.at[:, self.host.actuator("scope/roll").id].set(limit)
        own = {"actuator_forcerange": limits, "opt.gravity": entry_gravity(tables, parameters)}
        return model.tree_replace(own), axes.tree_replace(dict.fromkeys(own, 0))

    def _controls(self, parameters: Parameters, worlds: State, hands: Controls) -> Array:
        """Hand, wires, and how firmly what is outside is held."""
        host, kind = self.host, worlds.qpos.dtype
        control = jnp.zeros((len(worlds.time), host.nu), kind)
        named = {"scope/push": hands.push_rate, "scope/roll": hands.roll_rate}
        named |= {f"scope/pull_{name}": worlds.pulls[:, wire] for wire, name in enumerate(WIRE_NAMES)}
        columns = np.array([host.actuator(name).id for name in named])
        control = control.at[:, columns].set(jnp.stack(list(named.values()), axis=-1).astype(kind))
        return control.at[:, self.locks].set(self.lock_activation(parameters, worlds))

    def _data(self, worlds: int) -> Any:
        """What MuJoCo Warp works in. Its arrays are filled on the device: as constants they would be compiled in."""
        with jax.ensure_compile_time_eval():
            spheres = len(self.inverse_inertia)
            one = mjx.make_data(self.host, impl="warp", naconmax=worlds * spheres, njmax=self.rows)
        one = jax.tree.map(filled, one)
        return jax.vmap(lambda _: one)(jnp.arange(worlds))


def for_warp(model: mujoco.MjModel) -> mujoco.MjModel:
    """With a solver that Warp has, and without a flag that it does not know: it never resets what diverges.

    Dense Jacobians, which scenes ask for, it takes up to 60 dofs only: it is to choose.
    """
    model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_AUTO
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return model


def with_columns(shared: Array, values: Array, count: int) -> Array:
    """One row a world of an array that they share, its first `count` columns given."""
    rows = jnp.broadcast_to(shared, (len(values), *shared.shape))
    return rows.at[..., :count].set(values)


def filled(part: Any) -> Any:
    """An array whose entries are all the same as one that is filled when it is needed."""
    if not isinstance(part, jax.Array) or part.size < 2:
        return part
    values = np.asarray(part)
    first = values.flat[0]
    return jnp.full(values.shape, first, values.dtype) if (values == first).all() else part
