"""A scope laid along a lumen by hand: bent to the centreline in no time, although its rest shape is straight."""

import mujoco
import numpy as np

from haustra.envs.sim.native import NativeEngine


def lay_along(engine: NativeEngine, insertion: float) -> None:
    """Turn each joint inside so that what is behind it points along the centreline; speeds are zero then.

    Args:
        engine: its state is changed.
        insertion: how much of the scope is to be past the anus [m].
    """
    model, cable = engine.model, engine.scene.cable
    data = mujoco.MjData(model)
    line = engine.scene.colon.centreline
    start = engine.scene.options.start_depth
    data.qpos[0] = insertion - start
    depth = insertion - (cable.length - cable.joint_positions)
    ends = np.append(depth[1:], insertion)
    for index in np.flatnonzero(depth > 0):
        mujoco.mj_kinematics(model, data)
        body = model.body(cable.links[index + 1]).id
        target = [np.interp(ends[index], line.arc, line.points[:, axis]) for axis in range(3)]
        wanted = np.array(target) - data.xpos[body]
        wanted /= np.linalg.norm(wanted)
        pointing = data.xmat[body].reshape(3, 3)[:, 2]
        turn = np.cross(pointing, wanted)
        size = np.linalg.norm(turn)
        if size < 1e-9:
            continue
        turn *= np.arctan2(size, pointing @ wanted) / size
        for side in "xy":
            joint = model.joint(f"scope/bend_{side}_{index:03d}").id
            angle = float(turn @ data.xaxis[joint])
            if model.jnt_limited[joint]:
                angle = float(np.clip(angle, *model.jnt_range[joint]))
            data.qpos[model.jnt_qposadr[joint]] = angle
    engine.put(data.qpos)
