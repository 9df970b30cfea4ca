"""Where a magnetic imager's coils sit: on the spheres of the scope next to fixed distances behind its tip."""

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Int

from haustra.models.wall.planes import Sample

COIL_DISTANCES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
"""Behind the tip [m]; engineering choice: enough of a scope to tell loops by."""


def coil_samples(model: mujoco.MjModel, samples: Sequence[Sample]) -> Int[np.ndarray, " coils"]:
    """The sphere next to each of `COIL_DISTANCES`, at most half their spacing off, with the scope straight."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    places = [
        data.body(sample.body).xpos + data.body(sample.body).xmat.reshape(3, 3) @ sample.position for sample in samples
    ]
    behind = np.linalg.norm(data.site("scope/tip").xpos - np.array(places), axis=1)
    return np.abs(behind[:, None] - np.array(COIL_DISTANCES)).argmin(axis=0)
