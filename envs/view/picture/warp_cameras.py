"""Tip cameras of many worlds at once: how far the wall is in each pixel, by MuJoCo Warp's ray tracer.

The colons stand side by side in one model, farther apart than a camera sees; each world's camera is put into its own.
Without a GPU the same kernels run on the CPU, slowly: for tests.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
import warp as wp
from jaxtyping import Float, Int, UInt8
from mujoco.mjx.third_party import mujoco_warp

from haustra.envs.runs.warp_kernels import along_rays
from haustra.envs.sim.warp_setup import use_warp
from haustra.envs.view.picture.lens import camera_axes, lens_rays
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.lumen_meshes import add_lumen

_GAP = 0.5
"""Between neighbours [m]; more than any camera sees."""


class WarpCameras:
    """Depth pictures in some colons."""

    def __init__(
        self,
        colons: Sequence[Colon],
        *,
        worlds: int,
        size: int,
        field_of_view_deg: float,
        reach: float,
        device: str | None = None,
    ) -> None:
        """Put the colons' surfaces on the device; kernels compile with the first picture.

        Args:
            colons: as their scopes see them: entries at the origin, along z.
            worlds: cameras.
            size: rows and columns of a picture.
            field_of_view_deg: full angle over the diameter of the picture, less than 180 [degrees].
            reach: distance beyond which nothing is seen [m].
            device: as Warp names it; its own choice when None.
        """
        use_warp()
        self._places = _side_by_side(colons)
        model = _model(colons, self._places, reach)
        rays, within = lens_rays(field_of_view_deg, size)
        self._shape, self._reach = (worlds, size, size), reach
        self._device = wp.get_device(device)
        with wp.ScopedDevice(self._device):
            self._model, data = mujoco_warp.put_model(model), mujoco.MjData(model)
            mujoco.mj_forward(model, data)
            self._data = mujoco_warp.put_data(model, data, nworld=worlds)
            self._context = mujoco_warp.create_render_context(
                model, worlds, cam_res=(size, size), render_rgb=False, render_depth=True, use_textures=False
            )
            self._context.ray.assign((rays.reshape(-1, 3) @ camera_axes(np.eye(3))).astype(np.float32))
            self._within = wp.array(within.ravel().astype(np.uint8), dtype=wp.uint8)
            self._bytes = wp.empty((worlds, size * size), dtype=wp.uint8)
            mujoco_warp.refit_bvh(self._model, self._data, self._context)

    def depth(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        frame: Float[np.ndarray, "worlds 3 3"],
        beyond: Float[np.ndarray, "worlds 3"],
    ) -> UInt8[np.ndarray, "worlds size size"]:
        """Distance to the wall in each pixel, 255 for the reach and beyond; zero outside the lens's circle.

        The wall is seen from inside only. A tip that has pressed a little way into it sees the lumen behind it, and
        nothing but wall where it presses.

        Args:
            case: which colon each world is in.
            eye: where the cameras are [m].
            frame: columns are wire 'up', wire 'left' and the viewing direction.
            beyond: outwards, for cameras that are beyond the wall; zero for those in the lumen (`Sight.beyond`).
        """
        camera = camera_axes(frame)
        with wp.ScopedDevice(self._device):
            self._data.cam_xpos.assign((eye + self._places[case])[:, None].astype(np.float32))
            self._data.cam_xmat.assign(camera[:, None].astype(np.float32))
            mujoco_warp.render(self._model, self._data, self._context)
            against = wp.array(np.einsum("wij,wi->wj", camera, beyond).astype(np.float32), dtype=wp.vec3)
            seen = [self._context.depth_data, self._context.ray, self._within, against, self._reach]
            wp.launch(along_rays, self._bytes.shape, seen, [self._bytes])
            return self._bytes.numpy().reshape(self._shape)


def _side_by_side(colons: Sequence[Colon]) -> Float[np.ndarray, "colons 3"]:
    """Where each colon stands [m]: on a cubic grid, so that single precision is as fine as can be."""
    room = _GAP + max(float(np.ptp(colon.lumen.vertices, axis=0).max()) for colon in colons)
    side = int(np.ceil(len(colons) ** (1 / 3)))
    cells = np.stack(np.unravel_index(np.arange(len(colons)), (side, side, side)), axis=-1)
    middles = np.array([(colon.lumen.vertices.min(0) + colon.lumen.vertices.max(0)) / 2 for colon in colons])
    return room * cells - middles


def _model(colons: Sequence[Colon], places: np.ndarray, reach: float) -> mujoco.MjModel:
    """All surfaces and one camera. Where the camera sees to is counted from the model's size, which is set to 1 m."""
    spec = mujoco.MjSpec()
    spec.stat.extent = 1.0
    spec.visual.map.zfar = reach
    spec.worldbody.add_camera(name="tip")
    for number, (colon, place) in enumerate(zip(colons, places, strict=True)):
        add_lumen(spec, colon, group=0, prefix=f"colon_{number:04d}/", place=place)
    return spec.compile()
