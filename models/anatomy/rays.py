"""Exact distances from points inside the lumen to its surface, along rays."""

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.errors import InvalidMeshError
from haustra.models.anatomy.colon import Surface

REACH = 1.0
"""Longest ray [m]: no line of sight inside a colon is longer."""


class LumenRays:
    """A lumen surface against which rays are cast; MuJoCo's mesh bounding-volume hierarchy does the work."""

    def __init__(self, surface: Surface):
        """Build the hierarchy once.

        Raises:
            InvalidMeshError: when MuJoCo refuses the surface.
        """
        spec = mujoco.MjSpec()
        mesh = spec.add_mesh(name="lumen", uservert=surface.vertices.ravel(), userface=surface.faces.ravel())
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="lumen", contype=0, conaffinity=0)
        try:
            self._model = spec.compile()
        except ValueError as error:
            raise InvalidMeshError(f"The surface cannot be compiled: {' '.join(str(error).split())}.") from error
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)

    def cast(
        self, origins: Float[np.ndarray, "origins 3"], directions: Float[np.ndarray, "origins rays 3"]
    ) -> Float[np.ndarray, "origins rays"]:
        """Distance to the first hit [m] of each unit direction; infinity where nothing is hit within `REACH`."""
        rays = directions.shape[1]
        hit, distance = np.zeros(rays, np.int32), np.zeros(rays)
        result = np.empty(directions.shape[:2])
        flat = np.ascontiguousarray(directions, dtype=float).reshape(len(origins), -1)
        for row, (origin, bundle) in enumerate(zip(np.ascontiguousarray(origins, dtype=float), flat, strict=True)):
            mujoco.mj_multiRay(self._model, self._data, origin, bundle, None, 1, -1, hit, distance, None, rays, REACH)
            result[row] = np.where(hit < 0, np.inf, distance)
        return result

    def clear(self, starts: Float[np.ndarray, "segments 3"], ends: Float[np.ndarray, "segments 3"]) -> np.ndarray:
        """Whether the straight line from each start to its end meets no wall."""
        step = ends - starts
        length = np.linalg.norm(step, axis=1)
        direction = step / np.maximum(length, 1e-12)[:, None]
        return (length < 1e-12) | (self.cast(starts, direction[:, None])[:, 0] > length)


def lumen_table(
    rays: LumenRays,
    points: Float[np.ndarray, "stations 3"],
    frames: Float[np.ndarray, "stations 3 3"],
    angles: int,
) -> Float[np.ndarray, "stations angles"]:
    """Distance to the wall [m] at each station, at angle 2*pi*k/angles from the first normal towards the second.

    A ray that slips between two triangles takes the mean of its neighbours.

    Raises:
        InvalidMeshError: when a whole station sees no wall: it is outside the lumen.
    """
    turn = 2 * np.pi * np.arange(angles) / angles
    directions = np.einsum("a,si->sai", np.cos(turn), frames[:, :, 0])
    directions += np.einsum("a,si->sai", np.sin(turn), frames[:, :, 1])
    found = rays.cast(points, directions)
    lost = ~np.isfinite(found)
    if lost.mean(1).max() > 0.5:
        raise InvalidMeshError("A point of the centreline sees no wall: the surface is not closed.")
    for station, angle in np.argwhere(lost):
        known = np.flatnonzero(~lost[station])
        found[station, angle] = np.interp(angle, known, found[station, known], period=angles)
    return found
