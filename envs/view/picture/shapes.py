"""What MuJoCo would draw of a model, as one coloured triangle surface: spheres, capsules, cylinders, boxes, meshes."""

import mujoco
import numpy as np
from jaxtyping import Float, Int

from haustra.envs.view.picture.raster import vertex_normals
from haustra.envs.view.picture.tube import Tube

_AROUND = 20
_SHOWN = 3
"""Geom groups below this are drawn, as MuJoCo's viewer does."""


def drawn_shapes(model: mujoco.MjModel, data: mujoco.MjData) -> Tube:
    """The surface of all geoms of moving bodies that are drawn, where they are in `data`.

    What stands still, as the colon does, is left out; corners of boxes and meshes are sharp.
    """
    shown = list(map(int, _shown(model)))
    vertices, faces, normals, colours, count = [], [], [], [], 0
    for geom in shown:
        corners, triangles, own = _shape(model, geom)
        frame = data.geom_xmat[geom].reshape(3, 3)
        vertices.append(corners @ frame.T + data.geom_xpos[geom])
        normals.append(own @ frame.T)
        faces.append(triangles + count)
        colours.append(np.tile(model.geom_rgba[geom, :3].astype(float), (len(corners), 1)))
        count += len(corners)
    if not shown:
        none = np.zeros((0, 3))
        return Tube(none, np.zeros((0, 3), int), none, none)
    return Tube(np.concatenate(vertices), np.concatenate(faces), np.concatenate(normals), np.concatenate(colours))


def _shown(model: mujoco.MjModel) -> Int[np.ndarray, " geoms"]:
    moves = model.body_weldid[model.geom_bodyid] > 0
    moves &= model.body_mocapid[model.geom_bodyid] < 0
    return np.flatnonzero(moves & (model.geom_group < _SHOWN) & (model.geom_rgba[:, 3] > 0))


def _shape(model: mujoco.MjModel, geom: int) -> tuple[Float[np.ndarray, "v 3"], np.ndarray, Float[np.ndarray, "v 3"]]:
    """Corners in the geom's own axes [m], triangles, and normals."""
    kind, size = mujoco.mjtGeom(int(model.geom_type[geom])), model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first, start = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        corners = model.mesh_vert[first : first + model.mesh_vertnum[mesh]].astype(float)
        return _flat(corners, model.mesh_face[start : start + model.mesh_facenum[mesh]])
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size
        squares = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return _flat(corners, np.array([part for a, b, c, d in squares for part in ((a, b, c), (a, c, d))]))
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        side, faces = _turned(np.array([[size[0], -size[1]], [size[0], size[1]]]))
        out = side * [1, 1, 0] / max(float(size[0]), 1e-15)
        ends = [_flat(*_turned(np.array(ring))) for ring in _discs(float(size[0]), float(size[1]))]
        corners = np.concatenate([side, *(end[0] for end in ends)])
        offsets = np.cumsum([len(side), *(len(end[0]) for end in ends)])
        faces = np.concatenate([faces, *(end[1] + at for end, at in zip(ends, offsets, strict=False))])
        return corners, faces, np.concatenate([out, *(end[2] for end in ends)])
    angle = np.linspace(-np.pi / 2, np.pi / 2, 17)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        profile = np.column_stack([size[0] * np.cos(angle), size[0] * np.sin(angle) + np.sign(angle) * size[1]])
        profile = np.insert(profile, 8, [size[0], -size[1]], axis=0)
        profile[9] = [size[0], size[1]]
        corners, faces = _turned(profile)
        return corners, faces, vertex_normals(corners, faces)
    if kind not in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_ELLIPSOID):
        return np.zeros((0, 3)), np.zeros((0, 3), int), np.zeros((0, 3))
    radii = size if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID else np.repeat(size[:1], 3)
    corners, faces = _turned(np.column_stack([np.cos(angle), np.sin(angle)]))
    corners = corners * radii
    return corners, faces, vertex_normals(corners, faces)


def _discs(radius: float, half: float) -> list[list[list[float]]]:
    """Profiles of a cylinder's ends."""
    return [[[0.0, -half], [radius, -half]], [[radius, half], [0.0, half]]]


def _turned(profile: Float[np.ndarray, "points 2"]) -> tuple[np.ndarray, np.ndarray]:
    """A surface of revolution about z of points (radius, height) from below upwards."""
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    rings = profile[:, None, :1] * circle
    corners = np.concatenate([rings, np.broadcast_to(profile[:, None, 1:], (*rings.shape[:2], 1))], axis=2)
    ring, k = np.meshgrid(np.arange(len(profile) - 1), np.arange(_AROUND), indexing="ij")
    here, beside = (ring * _AROUND + k).ravel(), (ring * _AROUND + (k + 1) % _AROUND).ravel()
    faces = [np.stack([here, beside, beside + _AROUND], 1), np.stack([here, beside + _AROUND, here + _AROUND], 1)]
    return corners.reshape(-1, 3), np.concatenate(faces)


def _flat(corners: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """With sharp corners: each triangle has its own."""
    own = corners[faces]
    normals = np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-15)
    return own.reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3), np.repeat(normals, 3, axis=0)
