"""A shipped policy: it drives a scope to the caecum, and its weights are read without torch.

It sees what the environments show: hand and scope, rays into the lumen, a magnetic imager, and running means of these.
"""

from pathlib import Path

from PIL import Image

import haustra

colon = haustra.grow_colon(seed=100_000)
scene = haustra.Scene.of(colon, haustra.load_device("paediatric-long"), friction=0.05)
run = haustra.simulate(scene, driver="insertion", seconds=120)
scores = haustra.write_run(Path("run"), scene=scene, run=run, film=lambda done, pictures: None)
print(f"{scores['outcome']} after {scores['simulated_s']:.0f} s, wall force up to {scores['wall_force_peak_N']:.0f} N")
print(scores["numerical_error"])

Image.open("run/outside.png").convert("RGB").resize((480, 480)).save("policy.webp")
