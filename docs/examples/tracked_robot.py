"""A tracked robot in a colon: its own driver steers four treads and four bellows along the lumen.

Any device runs so: `capsule`, `vine`, `inchworm`, `tracked`, or a TOML file of your own.
"""

from pathlib import Path

from PIL import Image

import haustra
from haustra.envs.view.device_folder import write_device_run

colon = haustra.grow_colon(seed=0)
robot = haustra.load_device("tracked")
run = haustra.run_device(robot, colon, seconds=10)
scores = write_device_run(Path("tracked"), colon=colon, run=run)
print(f"{run.outcome.value}: nose at {scores['tip_arc_m']:.2f} m, wall force up to {scores['wall_force_peak_N']:.1f} N")

Image.open("tracked/device.png").convert("RGB").resize((480, 480)).save("tracked_robot.webp")
