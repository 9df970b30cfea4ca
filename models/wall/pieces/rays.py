"""Rays against triangle surfaces: the lumen, or the faces of all pieces."""

import threading
from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float
from manifold3d import Manifold

from haustra.models.anatomy.colon import Surface


class Caster:
    """Casts rays at closed surfaces, with MuJoCo's bounding volume hierarchies, one for each surface.

    A hierarchy is searched along the whole ray: the pieces of a wall cost a quarter when each stretch has its own.
    Threads may cast at once.
    """

    def __init__(self, *surfaces: Surface):
        spec = mujoco.MjSpec()
        for number, surface in enumerate(surfaces):
            name = f"surface{number}"
            spec.add_mesh(
                name=name,
                uservert=surface.vertices.ravel().tolist(),
                userface=surface.faces.ravel().tolist(),
                inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
            )
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, contype=0, conaffinity=0)
        self._model = spec.compile()
        self._of_thread = threading.local()
        self._hit = np.zeros(1, np.int32)

    @property
    def _data(self) -> mujoco.MjData:
        """This thread's own: rays use its stack."""
        data = getattr(self._of_thread, "data", None)
        if data is None:
            data = self._of_thread.data = mujoco.MjData(self._model)
            mujoco.mj_kinematics(self._model, data)
        return data

    def distance(
        self, origin: Float[np.ndarray, " 3"], directions: Float[np.ndarray, "rays 3"]
    ) -> Float[np.ndarray, " rays"]:
        """Distance [m] from one origin along unit directions to the first hit; infinite where there is none."""
        return self._cast(origin, directions)[0]

    def reach(self, origin: Float[np.ndarray, " 3"], direction: Float[np.ndarray, " 3"]) -> float:
        """As `distance`, for a single ray; a third of the time."""
        met = mujoco.mj_ray(self._model, self._data, origin, direction, None, 1, -1, self._hit)
        return met if met >= 0 else np.inf

    def entry(
        self, origin: Float[np.ndarray, " 3"], directions: Float[np.ndarray, "rays 3"]
    ) -> Float[np.ndarray, " rays"]:
        """As `distance`, but 0 where the first hit is met from within the solid: the origin stands inside it.

        Where a solid ends in an edge thinner than rounding, its far face may be met before its near one. From inside,
        the other way is met from within as well.
        """
        distance, within = self._seen(origin, directions)
        if within.any():
            within[within] = self._seen(origin, -directions[within])[1]
        return np.where(within, 0.0, distance)

    def _seen(self, origin: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances, and whether each hit is met from within."""
        distance, normals = self._cast(origin, directions)
        return distance, np.isfinite(distance) & (np.einsum("ij,ij->i", normals, directions) > 0)

    def _cast(self, origin: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        count = len(directions)
        hit, distance, normals = np.empty(count, np.int32), np.empty(count), np.zeros(3 * count)
        flat = np.ascontiguousarray(directions, dtype=float).ravel()
        start = np.ascontiguousarray(origin, dtype=float)
        mujoco.mj_multiRay(
            self._model, self._data, start, flat, None, 1, -1, hit, distance, normals, count, mujoco.mjMAXVAL
        )
        return np.where(hit < 0, np.inf, distance), normals.reshape(count, 3)


def joined_hulls(pieces: Sequence[Float[np.ndarray, "_ 3"]]) -> Surface:
    """The faces of many convex pieces as one surface, wound outwards."""
    meshes = [Manifold.hull_points(vertices).to_mesh64() for vertices in pieces]
    corners = [np.asarray(mesh.vert_properties)[:, :3] for mesh in meshes]
    starts = np.cumsum([0, *(len(found) for found in corners[:-1])])
    faces = [np.asarray(mesh.tri_verts).astype(np.int64) + start for mesh, start in zip(meshes, starts, strict=True)]
    return Surface(np.concatenate(corners), np.concatenate(faces))
