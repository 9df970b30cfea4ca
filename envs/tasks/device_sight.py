"""The rays of `haustra.envs.tasks.sight` where JAX computes: thousands of cameras at once."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int, UInt8

from haustra.envs.sim.backend import AbstractBackend
from haustra.envs.sim.device_arrays import on_device
from haustra.envs.sim.precision import precise
from haustra.envs.tasks.sight import (
    DEPTH_STEPS,
    STEPS,
    Eyes,
    Lumens,
    March,
    Sight,
    begin_march,
    march,
    of_vectors,
    ray_directions,
)
from haustra.envs.view.picture.lens import lens_rays
from haustra.models.wall import moving_colon, vectors
from haustra.models.wall.lumen_table import pick


class DeviceEyes(Eyes):
    """Rays from the tips into some colons; places go to the device, distances come back."""

    def __init__(self, sight: Sight, backend: AbstractBackend | None = None) -> None:
        """Put the tables onto the device; the backend knows where colons that move are."""
        lumens = Lumens(*(jnp.asarray(part) for part in sight.lumens))
        self._backend = backend
        tables = backend and on_device(backend.tables)

        @precise
        def cast(rays, steps, case, eye, frame, arc, displacement):
            directions = jnp.einsum("wij,rj->wri", frame, rays)
            now = begin_march(jnp, arc, len(rays), steps[-1])
            stations, eyes, along = lumens.stations(case), vectors.of(eye[:, None]), vectors.of(directions)
            at_rest = None
            if tables is not None and displacement is not None:
                at_rest = moving_colon.back_to_reference(jnp, pick(tables, case), displacement)

            def further(now: March, distance: Any) -> tuple[March, None]:
                return march(jnp, lumens, stations, eyes, along, now, distance, of_vectors(jnp, at_rest)), None

            return jax.lax.scan(further, now, steps)[0].found

        def picture(rays, steps, *eyes):
            """Zero where a pixel has no ray."""
            share = cast(rays, steps, *eyes) / steps[-1]
            return jnp.rint(255 * jnp.where(rays.any(axis=1), share, 0.0)).astype(jnp.uint8)

        self._cast, self._picture = jax.jit(cast), jax.jit(picture)

    def tip_distances(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        frame: Float[np.ndarray, "worlds 3 3"],
        arc: Float[np.ndarray, " worlds"],
    ) -> Float[np.ndarray, "worlds rays"]:
        """Distance to the wall along the rays of `ray_directions` [m], for tips with these frames."""
        return np.asarray(self._cast(*self._asked(ray_directions(), STEPS, case, eye, frame, arc)), float)

    def depth(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        frame: Float[np.ndarray, "worlds 3 3"],
        arc: Float[np.ndarray, " worlds"],
        *,
        field_of_view_deg: float,
        size: int,
    ) -> UInt8[np.ndarray, "worlds size size"]:
        """Distance to the wall in each pixel, 255 for `RANGE` and beyond; zero outside the lens's circle."""
        rays, within = lens_rays(field_of_view_deg, size)
        rays = np.where(within[..., None], rays, 0.0).reshape(-1, 3)
        found = self._picture(*self._asked(rays, DEPTH_STEPS, case, eye, frame, arc))
        return np.asarray(found).reshape(len(case), size, size)

    def _asked(self, rays: np.ndarray, steps: np.ndarray, case: np.ndarray, *places: np.ndarray) -> tuple[Any, ...]:
        eye, frame, arc = (place.astype(np.float32) for place in places)
        displacement = self._backend and self._backend.displacement
        return rays.astype(np.float32), steps.astype(np.float32), case.astype(np.int32), eye, frame, arc, displacement
