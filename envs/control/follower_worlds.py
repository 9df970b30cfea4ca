"""The lumen follower of many worlds in JAX: the rules of `haustra.envs.control.follower` on tables of colons."""

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import jax.numpy as jnp

from haustra.envs.control import follower
from haustra.envs.control.follower import Steering
from haustra.envs.sim.precision import precise
from haustra.envs.sim.scope_values import Parameters
from haustra.envs.sim.state import Controls, Readings
from haustra.errors import InvalidOptionError
from haustra.models.wall import moving_colon
from haustra.models.wall.lumen_table import Tables

Array: TypeAlias = Any


@dataclass(frozen=True)
class WorldsFollower:
    """Push, steer along the lumen ahead, rotate, back off when the wall force rises.

    Raises:
        InvalidOptionError: when it is to steer by wheels.
    """

    settings: Any
    """Settings of any driver (`follower.Law`)."""
    tip_links: int
    """Links of the bending section, the last ones."""

    def __post_init__(self) -> None:
        if self.settings.steer != "pulls":
            raise InvalidOptionError("Many worlds are steered by pulls; steering by wheels needs the native backend.")

    def begin(self, worlds: int, kind: Any = jnp.float32) -> Any:
        """Memory of a follower that has seen nothing yet."""
        return self.settings.law().begin(jnp, worlds, kind)

    def gives_up(self, memory: Any) -> Any:
        """Which of those who remember so much end their runs."""
        return self.settings.law().gives_up(self.settings, memory)

    @precise
    def act(
        self, parameters: Parameters, tables: Tables, seen: Readings, time: Array, memory: Any, *, interval: float
    ) -> tuple[Controls, Any]:
        """Controls for the next `interval` [s].

        Args:
            parameters: of the worlds.
            tables: of each world's colon (`pick`).
            seen: what was seen.
            time: simulated time of each world [s].
            memory: what it remembers.
            interval: time to the next decision [s].
        """
        scope, own = parameters.scope, self.settings
        steering = Steering(
            pull_per_angle=scope.pull_per_angle * parameters.tip_bending,
            pull_limit=scope.pull_limit,
            bend_limit=jnp.minimum(scope.bend_limit, math.radians(own.steer_limit_deg)),
            lead=own.steer_lead,
            length=scope.length,
        )
        ahead = (seen.tip_arc + own.look_ahead)[:, None]
        decision, memory = follower.decide(
            jnp,
            own,
            steering,
            seen,
            memory,
            time=time,
            arc=seen.tip_arc,
            target=moving_colon.axis_at(jnp, tables, seen.displacement, ahead)[:, 0],
            interval=interval,
            tip_links=self.tip_links,
        )
        return Controls(*decision), memory
