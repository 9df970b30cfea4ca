"""Stock MuJoCo: a saved run in MuJoCo's own viewer, repeated from its controls.

The scene is plain MJCF with the wall's convex pieces; nothing of haustra is needed to step it. Where several pieces
press on one place haustra counts the deepest and stock MuJoCo each, so that the tip comes to lie some millimetres away.
"""

import os
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np

import haustra

colon = haustra.grow_colon(seed=7)
wall = haustra.build_wall(colon, method="prism")
scene = haustra.Scene.of(colon, "adult", wall=wall, mesentery=False)
haustra.write_run(Path("run"), scene=scene, run=haustra.simulate(scene, seconds=4), wall=wall)

model = mujoco.MjModel.from_xml_path("run/scene.xml")
data, recorded, path = mujoco.MjData(model), np.load("run/trajectory.npz"), []
steps = round(recorded["time"][0] / model.opt.timestep)
for ctrl in recorded["ctrl"]:
    data.ctrl = ctrl
    mujoco.mj_step(model, data, steps)
    path.append(data.site("scope/tip").xpos.copy())
away = 1e3 * np.linalg.norm(np.array(path) - recorded["tip"], axis=1)
print(f"MuJoCo alone: tip within {away.max():.1g} mm of haustra's run")
if "DISPLAY" in os.environ:
    import mujoco.viewer

    mujoco.viewer.launch(model, data)

plt.figure(figsize=(6, 3), layout="constrained")
plt.plot(recorded["time"], away)
plt.xlabel("time [s]")
plt.ylabel("tip, from haustra's run [mm]")
plt.savefig("mujoco_viewer.webp")
