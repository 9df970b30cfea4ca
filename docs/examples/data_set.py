"""A data set: pictures from the tip with depth, normals, flow, occlusion and masks, each exact.

`haustra dataset standard` makes 2,400 pictures; here it is one clip. Needs `pip install haustra[dataset]`.
"""

from dataclasses import replace
from pathlib import Path

from PIL import Image

from haustra.envs.view.dataset.make import make_dataset
from haustra.envs.view.dataset.settings import find_preset

settings = replace(find_preset("quick"), clips=3, frames=4, width=160, height=128, seconds=10.0)
made = make_dataset(Path("data_set"), settings, name="example")
print(f"{made['frames']} pictures; depth within {made['depth_error_mm']:.4f} mm")

Image.open("data_set/contact.png").convert("RGB").save("data_set.webp")
