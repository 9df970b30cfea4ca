"""The picture of the README.

`python -m haustra.scripts.bench.pages.readme_picture demo/run docs/images/first-light.png`.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from haustra.envs.view.picture.image import write_png


def side_by_side(run: Path) -> np.ndarray:
    """The outside view and the tip view of a run, on one background, 'height width 3'."""
    outside, tip = (np.asarray(Image.open(run / name).convert("RGB")) for name in ("outside.png", "tip.png"))
    beside = np.repeat(outside[:, -1:], tip.shape[1] + 40, axis=1)  # the outside view's ground runs on behind the lens
    canvas = np.concatenate([outside, beside], axis=1)
    top = (outside.shape[0] - tip.shape[0]) // 2
    rows, columns = np.mgrid[-1 : 1 : tip.shape[0] * 1j, -1 : 1 : tip.shape[1] * 1j]
    lens = (rows**2 + columns**2 < 0.97)[..., None]
    place = canvas[top : top + tip.shape[0], outside.shape[1] : outside.shape[1] + tip.shape[1]]
    place[:] = np.where(lens, tip, place)
    return canvas


if __name__ == "__main__":
    write_png(Path(sys.argv[2]), side_by_side(Path(sys.argv[1])))
