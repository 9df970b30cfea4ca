"""Many scopes in many colons at once by MuJoCo Warp: MuJoCo's own dynamics and contacts, through MJX.

It is the native batch (`haustra.envs.sim.native_batch`) on a GPU: one plane a sphere, put before every step where the
colon's table says that the wall is. Looking up, observing and driving are those of `JaxScopes`, whose chain in JAX
this replaces by MuJoCo's. Without a GPU the same kernels run on the CPU, slowly: for tests.
"""

from dataclasses import dataclass
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
from haustra.envs.sim.scope_worlds import JaxScopes, entry_gravity, sound_after
from haustra.envs.sim.state import Controls
from haustra.errors import UnsupportedSceneError
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.scene import Scene
from haustra.models.wall.law import normal_force, require_honoured, soft_contact
from haustra.models.wall.lumen_table import Tables, pick, query
from haustra.models.wall.plane_pose import plane_pose

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
        try:
            # Room is kept for all that can happen; its solver's limits would be told on stdout at every step.
            model = mjx.put_model(host, impl="warp").tree_replace({"opt._impl.warn_overflow": 0})
        except (NotImplementedError, ValueError) as error:
            raise UnsupportedSceneError(f"The backend 'warp' cannot honour this scope: {error}") from error
        planes = [f"wall/plane_{index:04d}_0" for index in range(len(scene.samples))]
        assert [host.pair(name).id for name in planes] == list(range(host.npair)), "one pair a sphere, in their order"
        assert [host.body(name).mocapid[0] for name in planes] == list(range(host.nmocap)), "so are the planes"
        spheres = [host.geom(f"wall/sphere_{index:04d}").id for index in range(len(scene.samples))]
        return cls(
            **vars(chain),
            host=host,
            model=model,
            inverse_inertia=host.body_invweight0[host.geom_bodyid[spheres], 0],
            locks=np.array([host.actuator(name).id for pair in scene.cable.locks for name in pair]),
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
        step = jax.vmap(mjx.step, in_axes=(axes, 0))

        def one(_: Any, now: tuple[State, Any]) -> tuple[State, Any]:
            def advance(margin: Array, data: Any) -> Any:
                return step(model.replace(pair_margin=margin), data)

            return self._step(own_tables, parameters, *now, hands, advance)

        return jax.lax.fori_loop(0, count, one, (worlds, self._data(len(worlds.time))))[0]

    def _step(
        self, tables: Tables, parameters: Parameters, worlds: State, data: Any, hands: Controls, step: Any
    ) -> tuple[State, Any]:
        scope, h = parameters.scope, self.timestep
        where = links.pose(self.chain, scope.links, worlds.qpos)
        points = self._samples(scope, where)
        found = query(jnp, tables, jnp.concatenate([points, self._tip(scope, where)], axis=1), worlds.arcs)
        depth = found.depth[:, :-1] + scope.radius[:, None] - tables.device_radius
        inwards = found.inwards[:, :-1]
        planes = plane_pose(jnp, points, scope.radius[:, None], depth, inwards)
        done = step(
            planes.margin,
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
        along = jnp.einsum("wpi,wpi->wp", inwards, self._speeds(where, points, done.qvel))
        stiffness = parameters.stiffness[:, None]
        damper = stiffness * (parameters.damping_time[:, None] + h)
        after = worlds._replace(
            qpos=done.qpos,
            qvel=done.qvel,
            hand=done.act,
            arcs=found.arcs,
            normal=normal_force(jnp, stiffness * depth, damper, along),
            warm=done.qacc_warmstart,
            time=worlds.time + h,
        )
        # MuJoCo takes what is no number for no pull.
        sound = sound_after(parameters, worlds, after) & jnp.isfinite(hands.pulls).all(axis=1)
        return tree_where(sound, after, worlds)._replace(healthy=sound), done

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
            "pair_margin": jnp.zeros_like(soft.impedance),
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
