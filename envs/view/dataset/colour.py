"""What a picture of a data set shows in colour."""

import numpy as np
from jaxtyping import UInt8

from haustra.envs.view.dataset.ground_truth import GroundTruth
from haustra.envs.view.picture import mucosa


def paint(truth: GroundTruth) -> UInt8[np.ndarray, "height width 3"]:
    """Mucosa as the lamps beside the lens show it: by the light of a lamp, which falls with the square of distance."""
    view = truth.view
    hit = view.triangle >= 0
    picture = np.zeros((*hit.shape, 3))
    facing = -(view.normals * view.lens.grid).sum(-1)[hit]
    light = np.clip(-facing if facing.mean() < 0 else facing, 0, 1) / (view.distance[hit] ** 2 + 0.006**2)
    picture[hit] = mucosa.colour(view.points()[hit]) * light[:, None]
    exposure = 1.3 / max(float(np.percentile(picture[hit].max(axis=1), 80)), 1e-9)
    picture = (1 - np.exp(-exposure * picture)) ** (1 / 1.15)
    return (255 * np.clip(picture, 0, 1) + 0.5).astype(np.uint8)
