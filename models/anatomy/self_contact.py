"""Where one loop of a colon lies against another."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.rays import LumenRays

NEAR = 1.5e-3
"""Lumens that come nearer to each other than this [m] touch: each of two walls is as thick."""
APART = 0.1
"""Stations farther than this [m] along the colon belong to different loops."""
GROUP = 0.05
"""Contacts whose ends are within this [m] along the colon are one."""


@dataclass(frozen=True)
class Contact:
    """Two stretches of the colon whose lumens nearly meet."""

    first: float
    """Arc length of the one nearer to the anus [m]."""
    second: float
    """Arc length of the other [m]."""
    gap: float
    """Smallest distance between their lumens [m]."""


def self_contacts(colon: Colon) -> tuple[Contact, ...]:
    """Contacts between loops, from where the radius field meets the wall; a grid of about 2 mm."""
    line = colon.centreline
    angles = colon.radius.shape[1]
    turn = 2 * np.pi * np.arange(angles) / angles
    plane = np.einsum("ak,sjk->saj", np.stack([np.cos(turn), np.sin(turn)], axis=1), line.frames[:, :, :2])
    wall = (line.points[:, None] + colon.radius[:, :, None] * plane).reshape(-1, 3)
    arc = np.repeat(line.arc, angles)
    owner = np.repeat(np.arange(len(line.arc)), angles)
    pairs = KDTree(wall).query_pairs(NEAR, output_type="ndarray")
    pairs = pairs[np.abs(arc[pairs[:, 0]] - arc[pairs[:, 1]]) > APART]
    if len(pairs) == 0:
        return ()
    # A ray along a bend may end on the wall of another station's stretch: a contact needs a wall in between.
    rays = LumenRays(colon.lumen)
    pairs = pairs[
        ~rays.clear(_inward(wall, line.points, owner, pairs[:, 0]), _inward(wall, line.points, owner, pairs[:, 1]))
    ]
    gap = np.linalg.norm(wall[pairs[:, 0]] - wall[pairs[:, 1]], axis=1)
    ends = np.sort(arc[pairs], axis=1)
    found: list[Contact] = []
    for k in np.argsort(gap):
        first, second = map(float, ends[k])
        if all(abs(first - c.first) > GROUP or abs(second - c.second) > GROUP for c in found):
            found.append(Contact(first, second, float(gap[k])))
    return tuple(sorted(found, key=lambda contact: contact.first))


def _inward(wall: np.ndarray, points: np.ndarray, owner: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Points a little inside the lumen from points on its wall."""
    inward = points[owner[which]] - wall[which]
    length = np.linalg.norm(inward, axis=1, keepdims=True)
    return wall[which] + np.minimum(NEAR / np.maximum(length, 1e-12), 0.3) * inward
