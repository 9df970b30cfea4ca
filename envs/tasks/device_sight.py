"""The rays of `haustra.envs.tasks.sight` where JAX computes: thousands of cameras at once."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from haustra.envs.engine.precision import precise
from haustra.envs.tasks.sight import STEPS, Lumens, March, Sight, begin_march, march, ray_directions


class DeviceSight:
    """Rays from the tips into some colons; places go to the device, distances come back."""

    def __init__(self, sight: Sight) -> None:
        """Put the tables onto the device."""
        lumens = Lumens(*(jnp.asarray(part) for part in sight.lumens))
        rays = jnp.asarray(ray_directions(), jnp.float32)

        @precise
        def distances(case, eye, frame, arc):
            directions = jnp.einsum("wij,rj->wri", frame, rays)
            now = begin_march(jnp, arc, len(rays), float(STEPS[-1]))

            def further(now: March, distance: Any) -> tuple[March, None]:
                return march(jnp, lumens, case, eye, directions, now, distance), None

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
        return np.asarray(self._distances(case.astype(np.int32), *places), float)
