"""The rays of `haustra.envs.tasks.sight` where JAX computes: thousands of cameras at once."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from haustra.envs.engine import moving_colon
from haustra.envs.engine.device_arrays import on_device
from haustra.envs.engine.device_batch import DeviceBatch
from haustra.envs.engine.precision import precise
from haustra.envs.tasks.sight import STEPS, Lumens, March, Sight, begin_march, march, ray_directions
from haustra.models.wall.radius_field import Tables, pick


class DeviceSight:
    """Rays from the tips into some colons; places go to the device, distances come back."""

    def __init__(self, sight: Sight, engine: DeviceBatch | None = None) -> None:
        """Put the tables onto the device; the engine knows where colons that move are."""
        lumens = Lumens(*(jnp.asarray(part) for part in sight.lumens))
        rays = jnp.asarray(ray_directions(), jnp.float32)
        self._engine = engine
        tables = engine and on_device(engine.tables)

        @precise
        def distances(case, eye, frame, arc, shift):
            directions = jnp.einsum("wij,rj->wri", frame, rays)
            now = begin_march(jnp, arc, len(rays), float(STEPS[-1]))
            at_rest = _taking_back(pick(tables, case), shift) if tables and shift is not None else None

            def further(now: March, distance: Any) -> tuple[March, None]:
                return march(jnp, lumens, case, eye, directions, now, distance, at_rest), None

            return jax.lax.scan(further, now, jnp.asarray(STEPS, jnp.float32))[0].found

        self._distances = jax.jit(distances)

    def tip_distances(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        frame: Float[np.ndarray, "worlds 3 3"],
        arc: Float[np.ndarray, " worlds"],
    ) -> Float[np.ndarray, "worlds rays"]:
        """Distance to the wall along the rays of `ray_directions` [m], for tips with these frames."""
        places = (np.asarray(part, np.float32) for part in (eye, frame, arc))
        return np.asarray(self._distances(case.astype(np.int32), *places, self._engine and self._engine.shift), float)


def _taking_back(tables: Tables, shift: Any) -> Callable[[Any, Any], Any]:
    """From points near some arc lengths to where they would be, had the colon not moved."""
    own = tables.mesentery
    assert own is not None, "displacements of a colon that is fixed in space"
    frames = moving_colon.turns_of(own, shift)
    return lambda points, arcs: moving_colon.taken_back(tables, shift, frames, points, arcs)
