"""Steering by the treads: each track at its own speed, so that the robot turns towards the lumen ahead.

The paper's device has one worm for all four treads and cannot do this: four motors are assumed. Like the scope's
follower it knows the centreline, which a real device does not.
"""

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Centreline
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign

_LOOK_AHEAD = 2 / 3
"""Of the core's length: a bend of a lumen's own radius is then still seen before the nose meets it."""
_LARGEST_SHARE = 2.0
"""Of the nominal tread speed; the inner tread may stand but not run back."""


class AxisSteering:
    """Pure pursuit of the centreline: tread speeds of a turn about the point that leads to the lumen ahead."""

    def __init__(self, line: Centreline, design: TrackedDesign) -> None:
        """Get to know the lumen's axis and the robot's size."""
        self._line = line
        self._ahead = _LOOK_AHEAD * design.core_length
        self._radius = design.nominal_diameter / 2
        azimuth = 2 * np.pi * np.arange(TRACKS) / TRACKS
        self._directions = np.stack([-np.sin(azimuth), np.cos(azimuth)], 1)  # of each track, left and up of the core

    def shares(
        self, position: Float[np.ndarray, "3"], frame: Float[np.ndarray, "3 3"], arc: float
    ) -> Float[np.ndarray, " tracks"]:
        """Speed of each tread over the nominal one.

        Args:
            position: Centre of the core [m].
            frame: Columns are forwards, left and up.
            arc: Of the core's centre [m].
        """
        station = min(int(np.searchsorted(self._line.arc, arc + self._ahead)), len(self._line.arc) - 1)
        target = frame.T @ (self._line.points[station] - position)
        # The circle along the core's axis through the target has curvature 2 y / d^2 (Coulter 1992, pure pursuit).
        curvature = 2 * target[1:] / (target @ target)
        return np.clip(1 - self._radius * (self._directions @ curvature), 0.0, _LARGEST_SHARE)
