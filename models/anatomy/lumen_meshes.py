"""The lumen's surface as a picture in a scene: in stretches, so that a camera need not draw what it cannot see."""

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from haustra.models.anatomy.colon import Colon

LUMEN_STRETCH = 0.1
"""Length of colon in one mesh [m]."""
LUMEN_PREFIX = "lumen_"
"""Name of each mesh and its geom; its number follows, counted from the anus."""


def add_lumen(
    spec: mujoco.MjSpec,
    colon: Colon,
    *,
    group: int,
    prefix: str = "",
    place: Float[np.ndarray, "3"] | None = None,
) -> None:
    """Add the surface without contact, each triangle to the stretch that its middle is beside.

    Args:
        spec: gets the meshes and their geoms.
        colon: the colon.
        group: of the geoms.
        prefix: before all names.
        place: where the colon's origin is to be [m]; where the spec's is when None.
    """
    vertices, faces = colon.lumen.vertices, colon.lumen.faces
    line = colon.centreline
    _, station = KDTree(line.points).query(vertices[faces].mean(axis=1))
    stretch = (line.arc[station] / LUMEN_STRETCH).astype(int)
    for number in range(int(line.length / LUMEN_STRETCH) + 1):
        own = faces[stretch == number]
        if len(own):
            geom = _add(spec, f"{prefix}{LUMEN_PREFIX}{number:03d}", vertices, own, group)
            geom.pos = np.zeros(3) if place is None else place


def _add(spec: mujoco.MjSpec, name: str, vertices: np.ndarray, faces: np.ndarray, group: int) -> mujoco.MjsGeom:
    used, corners = np.unique(faces, return_inverse=True)
    mesh = spec.add_mesh(
        name=name,
        uservert=np.ascontiguousarray(vertices[used], dtype=float).ravel(),
        # Wound inwards, so that the camera at the tip sees the front of each triangle.
        userface=np.ascontiguousarray(corners.reshape(-1, 3)[:, ::-1], dtype=np.int32).ravel(),
    )
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    return spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        contype=0,
        conaffinity=0,
        group=group,
        rgba=[0.86, 0.5, 0.46, 1],
    )
