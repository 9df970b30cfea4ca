"""Lumens whose answers are known: bent tubes."""

import numpy as np

from haustra.models.anatomy.colon import Surface
from haustra.models.anatomy.frames import centreline_through
from haustra.models.anatomy.tube import tube


def bent_tube(axis: np.ndarray, radius: float, *, step: float = 0.004, angles: int = 32) -> Surface:
    line = centreline_through(axis, step)
    return tube(line.points, line.frames, np.full((len(line.points), angles), radius))


def hairpin(leg: float, apart: float, count: int = 400) -> np.ndarray:
    """Up along z, round a half circle, and down again `apart` to the side."""
    length = 2 * leg + np.pi * apart / 2
    arc = np.linspace(0, length, count)
    angle = np.clip((arc - leg) / (apart / 2), 0, np.pi)
    down = np.maximum(arc - leg - np.pi * apart / 2, 0)
    x = apart / 2 * (1 - np.cos(angle))
    z = np.minimum(arc, leg) + apart / 2 * np.sin(angle) - down
    return np.column_stack([x, np.zeros(count), z])
