"""Depth pictures of all tips at once, seen where the physics is."""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from haustra.envs.tasks.bank import ColonSet
from haustra.envs.tasks.pictures import Pictures, in_bytes
from haustra.envs.tasks.sight import RANGE, BatchSight, Sight

if TYPE_CHECKING:
    from haustra.envs.tasks.device_sight import DeviceSight

DepthCameras: TypeAlias = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""From the colons, places [m], frames and arc lengths [m] of the tips to pictures (worlds, size, size) of bytes."""


def depth_cameras(
    engine: str,
    bank: ColonSet,
    sight: Sight,
    eyes: "BatchSight | DeviceSight",
    pictures: Pictures,
    *,
    worlds: int,
    size: int,
) -> DepthCameras:
    """MuJoCo Warp traces rays to the lumen's triangles; other engines follow them in its table.

    Args:
        engine: of the physics.
        bank: the colons.
        sight: rays on the host.
        eyes: who follows rays, on the host or on JAX's device.
        pictures: of the same cameras.
        worlds: how many tips.
        size: rows and columns of a picture.
    """
    if engine == "warp":
        from haustra.envs.view.picture.warp_cameras import WarpCameras

        colons = [case.colon() for case in bank.cases]
        cameras = WarpCameras(colons, worlds=worlds, size=size, field_of_view_deg=pictures.view, reach=RANGE)
        return lambda case, eye, frame, arc: cameras.depth(case, eye, frame, sight.beyond(case, eye, arc))
    if isinstance(eyes, BatchSight):
        return lambda case, eye, frame, arc: in_bytes(pictures.depth(case, eye, frame, arc, size, eyes.at_rest(case)))
    return partial(eyes.depth, field_of_view_deg=pictures.view, size=size)
