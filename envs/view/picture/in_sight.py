"""What a camera in the lumen cannot see need not be drawn: the surface behind it, and what is far along the colon."""

import mujoco
import numpy as np

from haustra.models.anatomy.lumen_meshes import LUMEN_PREFIX, LUMEN_STRETCH

SIGHT = 0.4
"""Farther along the colon than this nothing is drawn [m]; engineering choice. In a grown colon a camera in the lumen
saw more than 0.25 m of it at two of five places and more than 0.4 m at none. One that is pressed into the wall looks
out at other loops, and then misses them."""


class LumenInSight:
    """The stretches of the lumen in a compiled scene, of which a camera is shown those that it may see."""

    def __init__(self, model: mujoco.MjModel, camera: str = "scope/camera") -> None:
        """Find them, and the camera."""
        self._model, self._camera = model, model.camera(camera).id
        names = [model.geom(index).name for index in range(model.ngeom)]
        self._geoms = np.array([index for index, name in enumerate(names) if name.startswith(LUMEN_PREFIX)], int)
        self._begins = LUMEN_STRETCH * np.array([int(names[index].removeprefix(LUMEN_PREFIX)) for index in self._geoms])

    def show(self, data: mujoco.MjData, arc: float) -> int:
        """Show what may be seen from where the camera is, and hide the rest.

        Args:
            data: with the places of bodies and geoms; those of cameras are computed here.
            arc: arc length of the centreline beside the camera [m].

        Returns:
            Triangles shown.
        """
        model, geoms = self._model, self._geoms
        mujoco.mj_camlight(model, data)
        forward = -data.cam_xmat[self._camera].reshape(3, 3)[:, 2]
        ahead = (data.geom_xpos[geoms] - data.cam_xpos[self._camera]) @ forward + model.geom_rbound[geoms]
        near = (self._begins < arc + SIGHT) & (self._begins + LUMEN_STRETCH > arc - SIGHT)
        shown = near & (ahead > 0)
        model.geom_rgba[geoms, 3] = shown
        return int(model.mesh_facenum[model.geom_dataid[geoms[shown]]].sum())

    def show_all(self) -> None:
        """Show the whole lumen."""
        self._model.geom_rgba[self._geoms, 3] = 1.0
