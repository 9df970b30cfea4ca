"""The force with which a tracked robot pulls what hangs behind it."""

import mujoco
import numpy as np
from jaxtyping import Float


def tow_force(model: mujoco.MjModel, data: mujoco.MjData, joint: str) -> Float[np.ndarray, "3"]:
    """Force of the robot on what it tows after a step, in the world's frame [N]; `joint` is from `tow_scope`."""
    number = model.equality(joint).id
    rows = (data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY) & (data.efc_id == number)
    # The constraint's residual is the robot's site less the other, so its multiplier acts on the robot.
    return -np.asarray(data.efc_force[rows], float)
