"""Many scopes in many colons at once, in JAX: the chain of a scope against the tabulated wall.

Every spring and damper that is stiff against a time step is integrated by backward Euler: wall, friction, stops, hand
and locks add `h J^T A J` to the mass matrix, which costs no more than the composite inertias that are there anyway. So
the wall has its stiffness to rounding at rest, as in the native backend, and steps of 5 ms are stable.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from haustra.envs.sim import chain as links
from haustra.envs.sim.device_arrays import tree_where
from haustra.envs.sim.link_places import middle_spheres
from haustra.envs.sim.physics.hand import HAND_DAMPING, hand_force
from haustra.envs.sim.physics.lock import lock_activation
from haustra.envs.sim.physics.stops import stop_torque
from haustra.envs.sim.physics.wires import borne_pulls, sheath_angle
from haustra.envs.sim.precision import precise
from haustra.envs.sim.scope_reading import ScopeChain, read_chain, read_scope
from haustra.envs.sim.scope_values import Array, Contact, Parameters, Scope, State
from haustra.envs.sim.state import SPEED_LIMIT, Controls, Readings
from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.wires import WIRE_NAMES, arriving_pulls
from haustra.models.scene import Scene
from haustra.models.wall import moving_colon
from haustra.models.wall.law import implicit_contact, normal_force
from haustra.models.wall.lumen_table import Tables, WallQuery, pick, query
from haustra.models.wall.moving_colon import AttachmentPoints, AxisDisplacement


@dataclass(frozen=True, kw_only=True)
class JaxScopes(ScopeChain):
    """How one kind of scope hangs together, for any number of worlds: a pure function of state, inputs, parameters."""

    designs_share: ClassVar[bool] = True
    """Whether worlds of one batch may be of several designs."""

    timestep: Array
    """[s]: a number, or what JAX traces, for programs of any time step."""

    @classmethod
    def of(cls, scene: Scene) -> "JaxScopes":
        """Read a scene of wall law 'table'; its own colon does not matter.

        Raises:
            UnsupportedSceneError: when the scene has what this backend cannot honour.
        """
        return cls(timestep=scene.options.timestep, **vars(read_chain(scene)))

    def parameters(
        self, scene: Scene, worlds: int, *, scope: Scope | None = None, kind: Any = jnp.float32, **changed: Any
    ) -> Parameters:
        """The scene's own parameters for that many worlds, but for those `changed`: numbers, or one a world.

        Args:
            scene: the scene.
            worlds: how many.
            scope: one design, or one a world (`stack_scopes`); the scene's own when not given.
            kind: precision.
            changed: entries of `Parameters`.

        Raises:
            InvalidOptionError: when a parameter is not known.
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
        numbers = {name: value if name == "colon" else value.astype(kind) for name, value in numbers.items()}
        design: Scope = jax.tree.map(lambda part: jnp.asarray(part, kind), scope or read_scope(scene))
        return Parameters(scope=design, **numbers)

    def check(self, parameters: Parameters) -> None:
        """Refuse parameters that the backend cannot honour; this one can all."""

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
            displacement=tables.mesentery and moving_colon.at_rest(jnp, tables.mesentery, count, kind),
        )

    def step(self, tables: Tables, parameters: Parameters, worlds: State, hands: Controls) -> State:
        """One time step of all worlds."""
        return self._stepped(tables, parameters, self.arrived(parameters, worlds, hands), hands)

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
    def _stepped(self, tables: Tables, parameters: Parameters, worlds: State, hands: Controls) -> State:
        chain, h, scope = self.chain, self.timestep, parameters.scope
        where = links.pose(chain, scope.links, worlds.qpos)
        own = links.inertias(scope.links, where)
        own_tables = pick(tables, parameters.colon)
        bias = links.bias(chain, where, own, worlds.qvel, entry_gravity(own_tables, parameters))
        contact = self._wall(own_tables, parameters, worlds, where)
        points = contact.points
        force = contact.law.force(jnp, self._speeds(where, points, worlds.qvel) - contact.wall_speed)
        of_body = self._body_sums(links.wrench(points, force))
        felt = self._body_sums(links.point_inertia(points, h * contact.law.damping(jnp)))
        torque, damping = self._joints(parameters, worlds)
        torque = torque + links.joint_forces(chain, where, links.suffix_sum(of_body - bias))
        matrix = links.mass_matrix(chain, where, links.suffix_sum(own + felt))
        armature = scope.armature * self._scales(parameters)
        matrix = matrix + jnp.eye(armature.shape[1], dtype=torque.dtype) * (armature + h * damping)[:, None]
        qvel = worlds.qvel + h * solve(matrix, torque)
        qpos = worlds.qpos + h * qvel
        leaving = self._speeds(where, points, qvel) - contact.wall_speed
        along = jnp.einsum("wpi,wpi->wp", contact.law.inwards, leaving)
        normal = normal_force(jnp, contact.law.spring, contact.law.damper, along)
        rates = jnp.stack([hands.push_rate, hands.roll_rate], axis=-1).astype(qpos.dtype)
        displacement = self._moved(own_tables, worlds.displacement, contact, leaving)
        after = worlds._replace(
            qpos=qpos,
            qvel=qvel,
            hand=worlds.hand + h * rates,
            arcs=contact.arcs,
            normal=normal,
            displacement=displacement,
        )
        sound = sound_after(parameters, worlds, after)
        if displacement is not None:
            sound &= jnp.isfinite(displacement.pose).all(axis=(1, 2))
        return tree_where(sound, after._replace(time=worlds.time + h), worlds)._replace(healthy=sound)

    def steps(self, tables: Tables, parameters: Parameters, worlds: State, hands: Controls, count: Any) -> State:
        """Several time steps under the same inputs; differentiable when `count` is a number and not an array."""
        worlds = self.arrived(parameters, worlds, hands)
        return jax.lax.fori_loop(0, count, lambda _, now: self._stepped(tables, parameters, now, hands), worlds)

    @precise
    def read(self, parameters: Parameters, tables: Tables, worlds: State) -> Readings:
        """Read off all worlds."""
        scope = parameters.scope
        where = links.pose(self.chain, scope.links, worlds.qpos)
        own = pick(tables, parameters.colon)
        spheres = self._samples(scope, where)
        found, _ = look(own, worlds.displacement, spheres, worlds.arcs[:, :-1], scope.radius)
        forces = self._body_sums(worlds.normal[..., None] * found.inwards)
        hand = self._hand(parameters, worlds)
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

    def _wall(self, tables: Tables, parameters: Parameters, worlds: State, where: links.Pose) -> Contact:
        scope = parameters.scope
        centres = self._samples(scope, where)
        places = jnp.concatenate([centres, self._tip(scope, where)], axis=1)
        found, grip = look(tables, worlds.displacement, places, worlds.arcs, scope.radius)
        # A thicker scope touches sooner, by as much as it is thicker: the table holds distances.
        depth = found.depth[:, :-1] + scope.radius[:, None] - tables.device_radius
        inwards = found.inwards[:, :-1]
        points = centres - scope.radius[:, None, None] * inwards
        wall_speed = jnp.zeros_like(points)
        if grip is not None and tables.mesentery is not None and worlds.displacement is not None:
            grip = AttachmentPoints(grip.arcs[:, :-1], grip.lever[:, :-1])
            wall_speed = moving_colon.wall_speeds(jnp, tables.mesentery, worlds.displacement, grip)
        speed = self._speeds(where, points, worlds.qvel) - wall_speed
        stiffness = parameters.stiffness[:, None]
        damper = stiffness * (parameters.damping_time[:, None] + self.timestep)
        friction = parameters.friction[:, None]
        law = implicit_contact(
            jnp, depth, inwards, speed, worlds.normal > 0, stiffness=stiffness, damper=damper, friction=friction
        )
        return Contact(points, found.arcs, law, wall_speed, grip)

    def _moved(
        self, tables: Tables, displacement: AxisDisplacement | None, contact: Contact, leaving: Array
    ) -> AxisDisplacement | None:
        """Where the colons go under what the scopes do to them, who leave the wall at that speed."""
        if displacement is None or tables.mesentery is None or contact.grip is None:
            return None
        pressed = -contact.law.force(jnp, leaving)
        damping = contact.law.damper + contact.law.drag
        return moving_colon.step_axis(
            jnp, tables.mesentery, displacement, contact.grip, pressed, damping, self.timestep
        )

    def _joints(self, parameters: Parameters, worlds: State) -> tuple[Array, Array]:
        """Torques of springs, stops, locks, hand and wires, and the damping that goes into the matrix."""
        kind, scope = worlds.qpos.dtype, parameters.scope
        scale = self._scales(parameters)
        stiffness, damping = scope.stiffness * scale, scope.damping * scale
        stops, stopped = stop_torque(jnp, worlds.qpos, scope.low, scope.high, timestep=self.timestep)
        damping = damping + stopped
        torque = -stiffness * (worlds.qpos - scope.rest) + stops
        held = self.lock_activation(parameters, worlds)
        dofs = self.lock_dofs.ravel()
        torque = torque.at[:, dofs].add(-scope.lock_stiffness * held * worlds.qpos[:, dofs])
        damping = damping.at[:, dofs].add(scope.lock_damping * held)
        pulled = (borne_pulls(jnp, worlds.pulls, scope.pull_limit[:, None])[:, None] @ scope.arms)[:, 0]
        torque = torque - pulled - damping * worlds.qvel
        # The hand's damper is in its force already; where the force is at its limit, it damps no more.
        hand = self._hand(parameters, worlds)
        free = jnp.abs(hand) < _hand_limits(parameters)
        torque = torque.at[:, :2].add(hand)
        damping = damping.at[:, :2].add(jnp.where(free, jnp.asarray(HAND_DAMPING, kind), 0.0))
        return torque, damping

    def _hand(self, parameters: Parameters, worlds: State) -> Float[Array, "worlds 2"]:
        return hand_force(jnp, worlds.hand, worlds.qpos[:, :2], worlds.qvel[:, :2], _hand_limits(parameters))

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


def look(
    tables: Tables, displacement: AxisDisplacement | None, points: Array, arcs: Array, radius: Array
) -> tuple[WallQuery, AttachmentPoints | None]:
    """Look spheres up in one colon a world; and where their surfaces hold on to it, if it moves."""
    if displacement is None:
        return query(jnp, tables, points, arcs), None
    return moving_colon.query(jnp, tables, displacement, points, arcs, radius)


def entry_gravity(tables: Tables, parameters: Parameters) -> Float[Array, "worlds 3"]:
    """Gravity in the frames of the entries [m/s^2], of one colon a world (`pick`)."""
    return jnp.einsum("wij,wi->wj", tables.axes, parameters.gravity)


def _hand_limits(parameters: Parameters) -> Float[Array, "worlds 2"]:
    return jnp.stack([parameters.push_limit, parameters.torque_limit], axis=-1)


def sound_after(parameters: Parameters, before: State, after: State) -> Array:
    """Which worlds are sound still: (worlds,)."""
    speeds = jnp.isfinite(after.qvel).all(axis=1) & (jnp.abs(after.qvel).max(axis=1) < SPEED_LIMIT)
    # Infinite speeds and pulls of the hand would pass: its force and what wires bear are limited.
    hand = jnp.isfinite(after.hand).all(axis=1) & jnp.isfinite(after.pulls).all(axis=1)
    # A wall whose law is no number would not be there: nothing compares as pressing on it.
    wall = jnp.isfinite(parameters.stiffness) & jnp.isfinite(parameters.damping_time)
    return before.healthy & speeds & hand & wall


def solve(matrix: Float[Array, "worlds dofs dofs"], right: Float[Array, "worlds dofs"]) -> Array:
    """Solve symmetric positive definite systems."""
    factor = jnp.linalg.cholesky(matrix)
    forth = jax.lax.linalg.triangular_solve(factor, right[..., None], left_side=True, lower=True)
    return jax.lax.linalg.triangular_solve(factor, forth, left_side=True, lower=True, transpose_a=True)[..., 0]
