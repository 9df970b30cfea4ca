"""A scope that enters at the origin along z, whatever its colon: colons take turns in front of it."""

import mujoco
import numpy as np

from haustra.models.scene import Scene, entry_of


def compile_at_origin(scene: Scene) -> mujoco.MjModel:
    """The scene with its scope at the origin, along z, its tip at the start depth; gravity comes along."""
    spec = scene.spec.copy()
    root = spec.body("scope/root")
    root.pos, root.quat = [0, 0, scene.options.start_depth - scene.cable.length], [1, 0, 0, 0]
    spec.option.gravity = entry_of(scene.colon)[1].T @ np.array(scene.options.gravity)
    return spec.compile()
