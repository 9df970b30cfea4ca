"""A scope's shaft, or the robot's own, behind the robot: a universal joint between its tip and the robot's rear."""

import mujoco
import numpy as np

from haustra.errors import InvalidOptionError
from haustra.models.devices.tracked.design import TrackedDesign
from haustra.models.devices.tracked.device import Tracked

_LARGEST_GAP = 3e-3
"""Between tip and robot at the start [m]: a joint closes it within some steps, with next to no force."""
_SOLREF, _SOLIMP = [0.005, 1.0], [0.99, 0.99, 1e-3, 0.5, 2]
"""Softness of the joint: five steps of 1 ms; one newton pulls tip and robot some hundredths of a millimetre apart."""


def arc_ahead_of(tip_arc: float, design: TrackedDesign) -> float:
    """Where the robot's centre stands when its rear touches a scope's tip at `tip_arc` [m from the anus]."""
    return tip_arc + design.core_length / 2 + design.core_diameter / 2


def tow_scope(spec: mujoco.MjSpec, tracked: Tracked, site: str) -> str:
    """Join a site of the scene (a scope's tip) to the robot's rear so that it may turn every way, but not part.

    The shaft then follows through bends as the cable that it is, and rubs on the wall there. `arc_ahead_of` says where
    the robot must stand.

    Returns:
        The equality's name; `haustra.envs.runs.measure.towing.tow_force` reads its force.

    Raises:
        InvalidOptionError: when the scene has no such site, or it is not at the robot's rear.
    """
    if spec.site(site) is None:
        raise InvalidOptionError(f"The scene has no site '{site}' to tow: a scope's own is 'scope/tip'.")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    gap = float(np.linalg.norm(data.site(site).xpos - data.site(tracked.tow).xpos))
    if gap > _LARGEST_GAP:
        raise InvalidOptionError(
            f"Site '{site}' is {gap * 1e3:.1f} mm from the robot's rear: stand the robot where `arc_ahead_of` says."
        )
    name = f"{tracked.tow}_joint"
    spec.add_equality(
        name=name,
        type=mujoco.mjtEq.mjEQ_CONNECT,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        name1=tracked.tow,
        name2=site,
        solref=_SOLREF,
        solimp=_SOLIMP,
    )
    return name
