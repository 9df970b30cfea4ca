"""A scope that enters at the origin along z, whatever its colon: colons take turns in front of it."""

import mujoco
import numpy as np

from haustra.models.scene import Scene, entry_of
from haustra.models.wall.piece_wall import BLOCK


def without_pieces(scene: Scene) -> mujoco.MjSpec:
    """A copy of the scene without the pieces of its wall."""
    spec = scene.spec.copy()
    for number in range(len(scene.blocks.arcs)):
        spec.delete(spec.body(f"{BLOCK}{number:03d}"))
    return spec


def compile_at_origin(scene: Scene) -> mujoco.MjModel:
    """The scene with its scope at the origin, along z, its tip at the start depth; gravity comes along.

    Pieces of a wall that nothing touches stay behind.
    """
    spec = without_pieces(scene)
    root = spec.body("scope/root")
    root.pos, root.quat = [0, 0, scene.options.start_depth - scene.cable.length], [1, 0, 0, 0]
    spec.option.gravity = entry_of(scene.colon)[1].T @ np.array(scene.options.gravity)
    return spec.compile()
