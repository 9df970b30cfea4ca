"""Depth pictures of all tips at once, seen where the physics is."""

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np

from haustra.envs.sim.backend import AbstractBackend
from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.sight import RANGE, Eyes, Sight

DepthCameras: TypeAlias = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""From the colons, places [m], frames and arc lengths [m] of the tips to pictures (worlds, size, size) of bytes."""


def depth_cameras(
    backend: AbstractBackend, bank: ColonSet, sight: Sight, eyes: Eyes, *, field_of_view_deg: float, size: int
) -> DepthCameras:
    """MuJoCo Warp traces rays to the lumen's triangles where it stands still; else they are followed in its table.

    Args:
        backend: of the physics.
        bank: the colons.
        sight: rays on the host.
        eyes: who follows rays, on the host or on JAX's device.
        field_of_view_deg: full angle over the diameter of a picture [degrees].
        size: rows and columns of a picture.
    """
    lens = {"field_of_view_deg": field_of_view_deg, "size": size}
    if not backend.traces_pictures or bank.options.mesentery:
        return partial(eyes.depth, **lens)
    from haustra.envs.view.picture.warp_cameras import WarpCameras

    colons = [case.colon() for case in bank.cases]
    cameras = WarpCameras(colons, worlds=backend.worlds, **lens, reach=RANGE)
    return lambda case, eye, frame, arc: cameras.depth(case, eye, frame, sight.beyond(case, eye, arc))
