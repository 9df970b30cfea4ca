"""Many scopes in many colons at once by MuJoCo Warp: MuJoCo's own dynamics and contacts, through MJX.

It is the native batch (`haustra.envs.sim.native_batch`) on a GPU, its walls those of `haustra.envs.sim.warp_planes`.
Observing is in JAX. Without a GPU the same kernels run on the CPU, slowly: for tests.
"""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

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
from haustra.envs.sim.state import Controls, Readings
from haustra.envs.sim.warp_planes import Contacts, WarpPlanes, look, sound
from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.wires import WIRE_NAMES, arriving_pulls
from haustra.models.scene import Scene
from haustra.models.wall import moving_colon
from haustra.models.wall.lumen_table import Tables, pick


@dataclass(frozen=True, kw_only=True)
class WarpScopes(ScopeChain):
    """One kind of scope, for any number of worlds: a pure function of state, inputs and parameters."""

    wall: WarpPlanes
    """The compiled model, and its planes."""
    locks: np.ndarray
    """(2 joints,) actuators that hold what is outside."""

    @classmethod
    def of(cls, scene: Scene) -> "WarpScopes":
        """Read a scene of wall law 'table'; its own colon does not matter.

        Raises:
            UnsupportedSceneError: when the scene has what this backend cannot honour.
        """
        chain = read_chain(scene, backend="warp")
        host, moves = batch_model(scene), scene.options.mesentery
        locks = np.array([host.actuator(name).id for pair in scene.cable.locks for name in pair])
        surrounded = scene.options.abdomen.surrounds
        wall = WarpPlanes.of(host, len(scene.samples), moves=moves, what="this scope", surrounded=surrounded)
        return cls(**vars(chain), wall=wall, locks=locks)

    @property
    def timestep(self) -> float:
        """Time step of all worlds [s]."""
        return self.wall.timestep

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
        self.wall.check(parameters.stiffness[:, None], parameters.damping_time[:, None])

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
        contacts = self._contacts(own_tables, parameters)
        worlds = self.arrived(parameters, worlds, hands)

        def one(_: Any, now: tuple[State, Any]) -> tuple[State, Any]:
            return self._step(own_tables, parameters, contacts, *now, hands)

        return jax.lax.fori_loop(0, count, one, (worlds, self.wall.data(len(worlds.time))))[0]

    @precise
    def read(self, parameters: Parameters, tables: Tables, worlds: State) -> Readings:
        """Read off all worlds."""
        scope = parameters.scope
        where = links.pose(self.chain, scope.links, worlds.qpos)
        own = pick(tables, parameters.colon)
        spheres = self._samples(scope, where)
        arcs, radius = worlds.arcs[:, :-1], scope.radius[:, None]
        found, _ = look(own, worlds.displacement, spheres, arcs, radius, threaded=spheres.shape[1])
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
        self,
        tables: Tables,
        parameters: Parameters,
        contacts: Contacts,
        worlds: State,
        data: Any,
        hands: Controls,
    ) -> tuple[State, Any]:
        scope = parameters.scope
        where = links.pose(self.chain, scope.links, worlds.qpos)
        places = jnp.concatenate([self._samples(scope, where), self._tip(scope, where)], axis=1)
        data = data.replace(
            qpos=worlds.qpos,
            qvel=worlds.qvel,
            act=worlds.hand,
            qacc_warmstart=worlds.warm,
            ctrl=self._controls(parameters, worlds, hands),
        )
        seen = places, worlds.arcs, scope.radius[:, None]
        host = self.wall.host
        local = jnp.asarray(host.body_ipos[host.geom_bodyid[self.wall.spheres]], places.dtype)
        centres = links.points_on(where, self.sample_body, local[None])
        when = data, worlds.healthy, worlds.time
        done = self.wall.step(contacts, tables, worlds.displacement, *seen, *when, centres=centres)
        after = worlds._replace(
            qpos=done.data.qpos,
            qvel=done.data.qvel,
            hand=done.data.act,
            arcs=done.arcs,
            normal=done.normal,
            warm=done.data.qacc_warmstart,
            displacement=done.displacement,
            time=worlds.time + self.timestep,
        )
        # Infinite speeds and pulls of the hand would pass, and MuJoCo takes what is no number for no pull. A wall whose
        # law is no number would not be there: nothing compares as pressing on it.
        law = parameters.stiffness, parameters.damping_time
        healthy = worlds.healthy & sound(after.qvel, after.hand, after.pulls, after.displacement, hands.pulls, law)
        return tree_where(healthy, after, worlds)._replace(healthy=healthy), done.data

    def _contacts(self, tables: Tables, parameters: Parameters) -> Contacts:
        """The wall's law, with what else worlds have for themselves; tables are those of each world (`pick`)."""
        model, scales = self.wall.model, self._scales(parameters)
        hand = np.array([self.wall.host.actuator(f"scope/{name}").id for name in ("push", "roll")])
        limit = jnp.stack([parameters.push_limit, parameters.torque_limit], axis=-1)
        limits = jnp.broadcast_to(model.actuator_forcerange, (len(limit), *model.actuator_forcerange.shape))
        own = {
            "jnt_stiffness": scales * model.jnt_stiffness,
            "dof_damping": scales * model.dof_damping,
            "dof_armature": scales * model.dof_armature,
            "actuator_forcerange": limits.at[:, hand].set(jnp.stack([-limit, limit], axis=-1)),
            "opt.gravity": jnp.einsum("wij,wi->wj", tables.axes, parameters.gravity),  # in the frames of the entries
        }
        stiffness, time, friction = parameters.stiffness, parameters.damping_time, parameters.friction
        return self.wall.contacts(stiffness[:, None], time[:, None], friction[:, None], own)

    def _controls(self, parameters: Parameters, worlds: State, hands: Controls) -> Array:
        """Hand, wires, and how firmly what is outside is held."""
        host, kind = self.wall.host, worlds.qpos.dtype
        control = jnp.zeros((len(worlds.time), host.nu), kind)
        named = {"scope/push": hands.push_rate, "scope/roll": hands.roll_rate}
        named |= {f"scope/pull_{name}": worlds.pulls[:, wire] for wire, name in enumerate(WIRE_NAMES)}
        columns = np.array([host.actuator(name).id for name in named])
        control = control.at[:, columns].set(jnp.stack(list(named.values()), axis=-1).astype(kind))
        return control.at[:, self.locks].set(self.lock_activation(parameters, worlds))

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

    def _samples(self, scope: Scope, where: links.Pose) -> Float[Array, "worlds points 3"]:
        return links.points_on(where, self.sample_body, scope.sample_place)

    def _tip(self, scope: Scope, where: links.Pose) -> Float[Array, "worlds 1 3"]:
        return links.points_on(where, np.array([where.origin.shape[1] - 1]), scope.tip_place)

    def _body_sums(self, per_sample: Array) -> Array:
        """Sums over the spheres of each body."""
        shape = (per_sample.shape[0], len(self.chain.last_dof), *per_sample.shape[2:])
        return jnp.zeros(shape, per_sample.dtype).at[:, self.sample_body].add(per_sample)
