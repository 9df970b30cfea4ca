"""A sheet of small pictures of a data set: colour and ground truths of one picture of each clip, from its files."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from haustra.envs.view.dataset.clip import MASKS, read_frame
from haustra.envs.view.picture.image import write_png

CONTACT = "contact.png"
_MOST = 12
"""Rows of a sheet."""
_NEAR = 0.1
"""Depth that is drawn black [m]; what is near is bright."""
_HUES = np.array(
    [
        *([0.15, 0.15, 0.18], [0.90, 0.62, 0.0], [0.34, 0.71, 0.91], [0.0, 0.62, 0.45]),
        *([0.94, 0.89, 0.26], [0.0, 0.45, 0.70], [0.84, 0.37, 0.0], [0.80, 0.47, 0.65]),
    ]
)
"""Colours that are told apart with any kind of colour vision (Okabe and Ito 2008), the first for none."""


def contact_sheet(folder: Path, clips: Sequence[tuple[str, int]]) -> Path:
    """Write `contact.png`: a row a clip; colour, depth, normals, flow, occlusion, segment, landmark and polyp.

    Args:
        folder: of the data set.
        clips: folder's name, and how many pictures it has.

    Raises:
        OutputError: when it cannot be written.
    """
    rows = [_row(folder / name, frames // 2) for name, frames in clips[:_MOST]]
    return write_png(folder / CONTACT, np.concatenate(rows))


def _row(clip: Path, frame: int) -> UInt8[np.ndarray, "height width 3"]:
    from PIL import Image

    def read(what: str) -> np.ndarray:
        return np.asarray(Image.open(clip / f"{frame:04d}_{what}.png"))

    held = read_frame(clip, frame)
    near = 1 - np.nan_to_num(held["depth"], nan=_NEAR) / _NEAR
    normals = np.nan_to_num((held["normals"] + 1) / 2)
    flow = held.get("flow", np.full((*near.shape, 2), np.nan))
    grey = [each[..., None].repeat(3, 2) for each in (near, read("occlusion") / 255.0)]
    masks = [_HUES[np.where(index > 0, 1 + (index.astype(int) - 1) % 7, 0)] for index in map(read, MASKS)]
    drawn = [grey[0], normals, _flow_colours(flow), grey[1], *masks]
    shown = [(255 * np.clip(each, 0, 1) + 0.5).astype(np.uint8) for each in drawn]
    return np.concatenate([read("color"), *shown], axis=1)


def _flow_colours(flow: Float[np.ndarray, "height width 2"]) -> Float[np.ndarray, "height width 3"]:
    """Direction as hue, length as strength; black where there is none."""
    from matplotlib.colors import hsv_to_rgb

    hue = np.arctan2(flow[..., 1], flow[..., 0]) / (2 * np.pi) % 1.0
    strength = np.clip(np.linalg.norm(flow, axis=-1) / 10.0, 0, 1)
    colours = hsv_to_rgb(np.nan_to_num(np.stack([hue, strength, np.ones_like(hue)], axis=-1)))
    return np.where(np.isfinite(flow).all(axis=-1, keepdims=True), colours, 0.0)
