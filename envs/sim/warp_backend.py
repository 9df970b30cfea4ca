"""Many scopes at once by MuJoCo's own dynamics and contacts on MuJoCo Warp, through MJX; a GPU makes it fast."""

from typing import Any, final

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.sim.backend import AbstractBackend
from haustra.envs.sim.conditions import Conditions, Snapshot
from haustra.envs.sim.device_arrays import on_device, tree_where
from haustra.envs.sim.scope_values import Parameters, State
from haustra.envs.sim.state import Controls, Readings, refuse_others
from haustra.envs.sim.warp_scopes import WarpScopes
from haustra.errors import UnsupportedSceneError
from haustra.models.scene import Scene
from haustra.models.wall import moving_colon
from haustra.models.wall.lumen_table import Tables, pick


@final
class WarpBackend(AbstractBackend):
    """Scopes on MuJoCo Warp. Only controls and readings travel between device and host."""

    name = "warp"
    on_device = True
    traces_pictures = True

    def __init__(self, scene: Scene, tables: Tables, *, worlds: int) -> None:
        """Read the scope; compilation comes with the first step.

        Args:
            scene: scope and options, built with wall_law "table" for any of the colons.
            tables: the colons, seen from their entries and stacked.
            worlds: how many.

        Raises:
            UnsupportedSceneError: when the scene has what this backend cannot honour.
        """
        self.scene, self.tables, self.worlds = scene, tables, worlds
        self._dynamics = dynamics = WarpScopes.of(scene)
        own = on_device(tables)
        self._parameters = self._dynamics.parameters(scene, worlds, colon=np.zeros(worlds, np.int32))
        self._state = self._dynamics.begin(self._parameters, own)

        def advance(parameters: Parameters, state: State, hands: Controls, count: Any) -> tuple[State, Readings]:
            state = dynamics.steps(own, parameters, state, hands, count)
            return state, dynamics.read(parameters, own, state)

        def begin(parameters: Parameters, state: State, roll: Any, anew: Any) -> tuple[State, Readings]:
            fresh = dynamics.begin(parameters, own)
            fresh = fresh._replace(qpos=fresh.qpos.at[:, 1].set(roll), hand=fresh.hand.at[:, 1].set(roll))
            state = tree_where(anew, fresh, state)
            return state, dynamics.read(parameters, own, state)

        def way(colon: Any, seen: Readings, distances: Any) -> Any:
            return moving_colon.axis_at(jnp, pick(own, colon), seen.displacement, seen.tip_arc[:, None] + distances)

        self._way = jax.jit(way)
        self._advance = jax.jit(advance)
        self._begin = jax.jit(begin)
        none = jnp.zeros(worlds, bool)
        self._state, self._seen = self._begin(self._parameters, self._state, jnp.zeros(worlds), none)
        self._seen.checked()  # the shapes stay

    def reset(self, worlds: Int[np.ndarray, " reset"], case: Int[np.ndarray, " reset"], conditions: Conditions) -> None:
        """Lay the scopes of some worlds straight, tips at the start depth, in the colons of those numbers."""
        changed = {
            "colon": case,
            "friction": conditions.friction,
            "stiffness": conditions.wall_stiffness,
            "bending": conditions.shaft_stiffness,
        }
        now = {}
        for name, values in changed.items():
            all_worlds = np.array(getattr(self._parameters, name))
            all_worlds[worlds] = values
            now[name] = jnp.asarray(all_worlds)
        parameters = self._parameters._replace(**now)
        self._dynamics.check(parameters)
        self._parameters = parameters
        roll, anew = np.zeros(self.worlds, np.float32), np.zeros(self.worlds, bool)
        anew[worlds] = True
        if conditions.roll is not None:
            roll[worlds] = conditions.roll
        self._state, self._seen = self._begin(self._parameters, self._state, jnp.asarray(roll), jnp.asarray(anew))

    def step(self, inputs: Controls, count: int) -> Bool[np.ndarray, " worlds"]:
        """Advance all worlds by `count` time steps; False for those that have diverged, which stand still from then."""
        refuse_others(inputs, self.worlds)
        hands = jax.tree.map(lambda part: jnp.asarray(part, jnp.float32), inputs)
        self._state, self._seen = self._advance(self._parameters, self._state, hands, count)
        return np.array(self._state.healthy)

    def read(self) -> Readings:
        """As `AbstractBackend.read`, in double precision; displacements stay on the device."""
        seen = jax.device_get(self._seen._replace(displacement=None))
        return jax.tree.map(lambda part: np.array(part, float), seen)

    @property
    def displacement(self) -> Any:
        """Displacements of the colons' axes (worlds, nodes, 3) [m], left on the device; None where they are fixed."""
        return self._seen.displacement

    def way_ahead(self, distances: Float[np.ndarray, " places"]) -> Float[np.ndarray, "worlds places 3"]:
        """Places of the centreline that far ahead of the tip, where they are now, from the entry [m]."""
        return np.asarray(self._way(self._parameters.colon, self._seen, jnp.asarray(distances, jnp.float32)), float)

    def positions(self) -> Float[np.ndarray, "worlds joints"]:
        """Joint positions of all scopes, as MuJoCo counts them."""
        return np.asarray(self._state.qpos)

    def snapshot(self, world: int) -> Snapshot:
        """Not kept.

        Raises:
            UnsupportedSceneError: always.
        """
        raise UnsupportedSceneError(
            "Withdrawal begins where scopes stood, which the backend 'warp' does not keep: use 'native'."
        )

    def restore(self, world: int, snapshot: Snapshot) -> None:
        """Not kept.

        Raises:
            UnsupportedSceneError: always.
        """
        self.snapshot(world)

    def world_data(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """Model and data of one world as MuJoCo's own values, to draw or to check."""
        from haustra.envs.sim.native_batch import posed

        return posed(self.scene, np.asarray(self._state.qpos[world]))

    def close(self) -> None:
        """Nothing is held open."""
