"""Many scopes in many colons at once by MuJoCo Warp: MuJoCo's own dynamics and contacts, through MJX.

It is the native batch (`haustra.envs.sim.native_batch`) on a GPU: one plane a sphere, put before every step where the
colon's table says that the wall is. A colon that moves is pushed on by MuJoCo's own contact forces. Looking up and
observing are in JAX. Without a GPU the same kernels run on the CPU, slowly: for tests.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Float
from mujoco import mjx

from haustra.envs.sim import chain as links
from haustra.envs.sim.device_arrays import tree_where
from haustra.envs.sim.link_places import middle_spheres
from haustra.envs.sim.native_batch import batch_model
from haustra.envs.sim.physics.hand import hand_force
from haustra.envs.sim.physics.lock import lock_activation
from haustra.envs.sim.physics.wires import sheath_angle
from haustra.envs.sim.precision import precise
from haustra.envs.sim.scope_reading import ScopeChain, read_chain, read_scope
from haustra.envs.sim.scope_values import Array, Parameters, Scope, State
from haustra.envs.sim.state import SPEED_LIMIT, Controls, Readings
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.models.devices.scope.wires import WIRE_NAMES, arriving_pulls
from haustra.models.scene import Scene
from haustra.models.wall import moving_colon
from haustra.models.wall.law import SLIP_SPEED, normal_force, require_honoured, soft_contact
from haustra.models.wall.lumen_table import Tables, WallQuery, pick, query
from haustra.models.wall.moving_colon import AttachmentPoints, AxisDisplacement
from haustra.models.wall.plane_pose import moving_planes, plane_pose

CONTACT_ROWS = 3
"""Constraint rows of a contact with friction."""


@dataclass(frozen=True, kw_only=True)
class WarpScopes(ScopeChain):
    """One kind of scope, for any number of worlds: a pure function of state, inputs and parameters."""

    timestep: float
    """[s]."""
    host: mujoco.MjModel
    """Compiled for the CPU, to make data of."""
    model: Any
    """Compiled model on the GPU for Warp, as MJX has it."""
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
        chain = read_chain(scene, backend="warp")
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
            timestep=scene.options.timestep,
            host=host,
            model=model,
            inverse_inertia=host.body_invweight0[host.geom_bodyid[spheres], 0],
            locks=np.array([host.actuator(name).id for pair in scene.cable.locks for name in pair]),
            planes=np.array([host.geom(name).id for name in planes]),
            sphere_of=sphere_of,
            rows=CONTACT_ROWS * len(spheres) + int(host.jnt_limited.sum()),
        )

    def parameters(self, scene: Scene, worlds: int, **changed: Any) -> Parameters:
        """The scene's own parameters for that many worlds, but for those `changed`: numbers, or one a world.

        Args:
            scene: the scene.
            worlds: how many.
            changed: entries of `Parameters`.

        Raises:
            InvalidOptionError: when a parameter is not known, or MuJoCo would clamp the wall's law.
        """
        options = scene.options
        own = {
            "colon": 0,
            "stiffness": options.wall_stiffness,
            "damping_time": options.wall_damping_time,
            "friction": options.friction,
            "bending": 1.0,
            "tip_bending": 1.0,
            "torsion": 1.0,
            "push_limit": options.push_limit,
            "torque_limit": options.torque_limit,
            "gravity": options.gravity,
        }
        for name in changed:
            if name not in own:
                raise InvalidOptionError(f"'{name}' cannot differ between worlds. What can: {', '.join(own)}.")
        own |= changed
        numbers = {
            name: jnp.broadcast_to(jnp.asarray(value), (worlds, 3) if name == "gravity" else (worlds,))
            for name, value in own.items()
        }
        numbers = {name: value if name == "colon" else value.astype(jnp.float32) for name, value in numbers.items()}
        design: Scope = jax.tree.map(lambda part: jnp.asarray(part, jnp.float32), read_scope(scene, backend="warp"))
        parameters = Parameters(scope=design, **numbers)
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

    @precise
    def begin(self, parameters: Parameters, tables: Tables) -> State:
        """All scopes straight, their tips at the start depth, colons that may move at rest."""
        count, kind = len(parameters.friction), parameters.friction.dtype
        qpos = jnp.zeros((count, len(self.chain.axis)), kind)
        where = links.pose(self.chain, parameters.scope.links, qpos)
        scope = parameters.scope
        arcs = jnp.concatenate([self._samples(scope, where)[..., 2], self._tip(scope, where)[..., 2]], axis=1)
        return State(
            qpos=qpos,
            qvel=jnp.zeros_like(qpos),
            hand=jnp.zeros((count, 2), kind),
            arcs=arcs,
            normal=jnp.zeros((count, len(self.sample_body)), kind),
            healthy=jnp.ones(count, bool),
            time=jnp.zeros(count, kind),
            pulls=jnp.zeros((count, len(WIRE_NAMES)), kind),
            warm=jnp.zeros_like(qpos),
            displacement=tables.mesentery and moving_colon.at_rest(jnp, tables.mesentery, count, kind),
        )

    def arrived(self, parameters: Parameters, worlds: State, hands: Controls) -> State:
        """State in which what gets through of the hands' pulls has arrived at the bending sections."""
        scope, (about_x, about_y) = parameters.scope, self.shaft_dofs
        angle = sheath_angle(jnp, worlds.qpos[:, about_x], worlds.qpos[:, about_y])
        pulls = arriving_pulls(
            jnp,
            hands.pulls.astype(worlds.qpos.dtype),
            worlds.pulls,
            friction=scope.wire_friction[:, None],
            hysteresis=scope.wire_hysteresis[:, None],
            sheath_angle=angle[:, None],
        )
        return worlds._replace(pulls=pulls)

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

    @precise
    def read(self, parameters: Parameters, tables: Tables, worlds: State) -> Readings:
        """Read off all worlds."""
        scope = parameters.scope
        where = links.pose(self.chain, scope.links, worlds.qpos)
        own = pick(tables, parameters.colon)
        spheres = self._samples(scope, where)
        found, _ = _look(own, worlds.displacement, spheres, worlds.arcs[:, :-1], scope.radius)
        forces = self._body_sums(worlds.normal[..., None] * found.inwards)
        limits = jnp.stack([parameters.push_limit, parameters.torque_limit], axis=-1)
        hand = hand_force(jnp, worlds.hand, worlds.qpos[:, :2], worlds.qvel[:, :2], limits)
        up, left = (worlds.qpos[:, dofs].sum(axis=1) for dofs in self.bend_dofs)
        return Readings(
            time=worlds.time,
            insertion=scope.start + worlds.qpos[:, 0],
            roll=worlds.qpos[:, 1],
            hand_lead=worlds.hand[:, 0] - worlds.qpos[:, 0],
            tip=self._tip(scope, where)[:, 0],
            tip_frame=where.rotation[:, -1],
            tip_arc=worlds.arcs[:, -1],
            bend=jnp.stack([up, -left], axis=-1),
            push_force=hand[:, 0],
            torque=hand[:, 1],
            tip_force=jnp.einsum("wij,wi->wj", where.rotation[:, -1], forces[:, -len(self.bend_dofs[0]) :].sum(axis=1)),
            link_forces=jnp.linalg.norm(forces, axis=-1),
            link_arcs=worlds.arcs[:, middle_spheres(self.sample_body, forces.shape[1])],
            deepest=found.depth.max(axis=1) + scope.radius - own.device_radius[:, 0],
            coils=spheres[:, self.coils],
            displacement=worlds.displacement and worlds.displacement.pose,
        )

    def _step(
        self, tables: Tables, parameters: Parameters, worlds: State, data: Any, hands: Controls, advance: Any
    ) -> tuple[State, Any]:
        scope, h = parameters.scope, self.timestep
        where = links.pose(self.chain, scope.links, worlds.qpos)
        points = self._samples(scope, where)
        places = jnp.concatenate([points, self._tip(scope, where)], axis=1)
        found, grip = _look(tables, worlds.displacement, places, worlds.arcs, scope.radius)
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
        sound = _sound_after(parameters, worlds, after) & jnp.isfinite(hands.pulls).all(axis=1)
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
        own = {"actuator_forcerange": limits, "opt.gravity": _entry_gravity(tables, parameters)}
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

    def lock_activation(self, parameters: Parameters, worlds: State) -> Array:
        """How firmly each bending dof is held outside the patient, 0 to 1: (worlds, 2 joints)."""
        scope = parameters.scope
        held = lock_activation(jnp, scope.start[:, None] + worlds.qpos[:, :1], scope.behind)
        return jnp.repeat(held, 2, axis=1)

    def shape(self, parameters: Parameters, worlds: State) -> Float[Array, "worlds nodes 3"]:
        """Points along the scopes' axes from the entry: handle end of the modelled part, each joint, and tip [m]."""
        where = links.pose(self.chain, parameters.scope.links, worlds.qpos)
        return jnp.concatenate([where.origin, self._tip(parameters.scope, where)], axis=1)

    def behind(self, parameters: Parameters) -> Float[Array, "any nodes"]:
        """Distance of each of those points from the tip along the scope [m]."""
        scope = parameters.scope
        length = scope.length[:, None]
        return jnp.concatenate([length, scope.behind, 0 * length], axis=1)

    def _scales(self, parameters: Parameters) -> Float[Array, "worlds dofs"]:
        one = jnp.ones_like(parameters.bending)
        choices = jnp.stack([one, parameters.bending, parameters.tip_bending, parameters.torsion], axis=-1)
        return choices[:, self.scale]

    def _speeds(self, where: links.Pose, points: Array, qvel: Array) -> Float[Array, "worlds points 3"]:
        velocity = links.velocities(self.chain, where, qvel)[:, self.sample_body]
        return velocity[..., 3:] + jnp.cross(velocity[..., :3], points)

    def _samples(self, scope: Scope, where: links.Pose) -> Float[Array, "worlds points 3"]:
        return links.points_on(where, self.sample_body, scope.sample_place)

    def _tip(self, scope: Scope, where: links.Pose) -> Float[Array, "worlds 1 3"]:
        return links.points_on(where, np.array([where.origin.shape[1] - 1]), scope.tip_place)

    def _body_sums(self, per_sample: Array) -> Array:
        """Sums over the spheres of each body."""
        shape = (per_sample.shape[0], len(self.chain.last_dof), *per_sample.shape[2:])
        return jnp.zeros(shape, per_sample.dtype).at[:, self.sample_body].add(per_sample)


def _look(
    tables: Tables, displacement: AxisDisplacement | None, points: Array, arcs: Array, radius: Array
) -> tuple[WallQuery, AttachmentPoints | None]:
    """Look spheres up in one colon a world; and where their surfaces hold on to it, if it moves."""
    if displacement is None:
        return query(jnp, tables, points, arcs), None
    return moving_colon.query(jnp, tables, displacement, points, arcs, radius)


def _entry_gravity(tables: Tables, parameters: Parameters) -> Float[Array, "worlds 3"]:
    """Gravity in the frames of the entries [m/s^2], of one colon a world (`pick`)."""
    return jnp.einsum("wij,wi->wj", tables.axes, parameters.gravity)


def _sound_after(parameters: Parameters, before: State, after: State) -> Array:
    """Which worlds are sound still: (worlds,)."""
    speeds = jnp.isfinite(after.qvel).all(axis=1) & (jnp.abs(after.qvel).max(axis=1) < SPEED_LIMIT)
    # Infinite speeds and pulls of the hand would pass: its force and what wires bear are limited.
    hand = jnp.isfinite(after.hand).all(axis=1) & jnp.isfinite(after.pulls).all(axis=1)
    # A wall whose law is no number would not be there: nothing compares as pressing on it.
    wall = jnp.isfinite(parameters.stiffness) & jnp.isfinite(parameters.damping_time)
    colon = [jnp.isfinite(part).reshape(len(speeds), -1).all(axis=1) for part in jax.tree.leaves(after.displacement)]
    return jnp.stack([before.healthy, speeds, hand, wall, *colon]).all(axis=0)


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
