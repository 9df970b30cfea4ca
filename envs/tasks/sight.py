"""What a camera at the tip could measure of the lumen: distances along rays, and which of the wall has been seen.

The lumen is taken as its distance from the centreline at each arc length and angle, so a fold hides what is behind it,
but nothing is seen round the corner of an overhang. Light, mucus and motion blur are left out.
"""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from haustra.envs.tasks.case import Case
from haustra.models.wall.radius_field import stack

RANGE = 0.12
"""Farthest distance that is measured [m]: the lamps show little beyond; engineering choice."""
RINGS_DEG = (20.0, 40.0, 60.0)
"""Angles of the rays from the viewing direction [degrees], within a camera's 140 degrees."""
RAYS = 8
"""Rays on each ring; one more goes straight ahead."""
_STEPS = RANGE * (np.arange(1, 25) / 24) ** 1.5
"""Places along a ray where the wall is looked for: 1 mm apart near the tip, 7 mm apart far off [m]."""
_WINDOW = 0.02
"""Largest change of arc length from one place on a ray to the next [m]."""


def ray_directions() -> Float[np.ndarray, "rays 3"]:
    """Unit vectors in the tip's frame: straight ahead, then ring by ring from wire 'up' towards wire 'left'."""
    turn = 2 * np.pi * np.arange(RAYS) / RAYS
    rays = [np.array([[0.0, 0.0, 1.0]])]
    for ring in RINGS_DEG:
        aside, ahead = math.sin(math.radians(ring)), math.cos(math.radians(ring))
        rays.append(np.column_stack([aside * np.cos(turn), aside * np.sin(turn), np.full(RAYS, ahead)]))
    return np.vstack(rays)


class Sight:
    """Rays into some colons."""

    def __init__(self, cases: Sequence[Case]) -> None:
        """Keep the tables in single precision, which is exact to a micrometre here."""
        tables = stack([case.tables for case in cases])
        self._points = tables.points.astype(np.float32)
        self._frames = tables.frames.astype(np.float32)
        self._sight = np.concatenate([case.sight for case in cases]).astype(np.float32)
        self._first, self._count, self._step = tables.first, tables.count, tables.step
        self._angles = self._sight.shape[1]

    def distances(
        self,
        case: Int[np.ndarray, " worlds"],
        eye: Float[np.ndarray, "worlds 3"],
        directions: Float[np.ndarray, "worlds rays 3"],
        arc: Float[np.ndarray, " worlds"],
        steps: Float[np.ndarray, " steps"] | None = None,
    ) -> Float[np.ndarray, "worlds rays"]:
        """Distance to the wall along rays [m], at most the last of `steps`.

        Args:
            case: which colon each world is in.
            eye: where the rays begin [m].
            directions: unit vectors.
            arc: arc length of the eye [m].
            steps: distances at which the wall is looked for [m].
        """
        steps = _STEPS if steps is None else steps
        arcs = np.broadcast_to(arc[:, None], directions.shape[:2]).astype(np.float32)
        start, way = eye[:, None].astype(np.float32), directions.astype(np.float32)
        found = np.full(arcs.shape, steps[-1], np.float32)
        open_rays = np.ones(arcs.shape, bool)
        room_before, before = np.full(arcs.shape, 1e-3, np.float32), 0.0
        for distance in steps:
            arcs, room = self._room(case, start + np.float32(distance) * way, arcs)
            hit = open_rays & (room <= 0)
            share = room_before / np.maximum(room_before - room, 1e-9)
            np.copyto(found, before + np.clip(share, 0, 1) * (distance - before), where=hit)
            open_rays &= ~hit
            if not open_rays.any():
                break
            room_before, before = np.maximum(room, 1e-6), distance
        return found.astype(float)

    def inside(
        self,
        case: Int[np.ndarray, " worlds"],
        points: Float[np.ndarray, "worlds points 3"],
        arcs: Float[np.ndarray, "worlds points"],
    ) -> Bool[np.ndarray, "worlds points"]:
        """Whether points near those arc lengths [m] lie in the lumen."""
        return self._room(case, points.astype(np.float32), arcs.astype(np.float32))[1] > 0

    def surface(
        self, case: int, rows: Int[np.ndarray, " cells"], columns: Int[np.ndarray, " cells"]
    ) -> Float[np.ndarray, "cells 3"]:
        """Places of the wall at stations and angles of one colon [m]."""
        row = self._first[case] + rows
        turn = 2 * np.pi * columns / self._angles
        across = self._frames[row, :, 0] * np.cos(turn)[:, None] + self._frames[row, :, 1] * np.sin(turn)[:, None]
        return (self._points[row] + self._sight[row, columns][:, None] * across).astype(float)

    def _room(self, case: np.ndarray, points: np.ndarray, arcs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Arc length of points that were near `arcs`, and the distance from there to the wall along the radius."""
        first, last = self._first[case][:, None], self._count[case][:, None] - 1
        step = self._step[case][:, None].astype(np.float32)
        row = first + np.clip(np.rint(arcs / step), 0, last).astype(np.int32)
        ahead = np.einsum("wpi,wpi->wp", points - self._points[row], self._frames[row, :, 2])
        arcs = (row - first) * step + np.clip(ahead, -_WINDOW, _WINDOW)
        inner = np.clip(np.rint(arcs / step), 0, last)
        row = first + inner.astype(np.int32)
        offset = points - self._points[row]
        x = np.einsum("wpi,wpi->wp", offset, self._frames[row, :, 0])
        y = np.einsum("wpi,wpi->wp", offset, self._frames[row, :, 1])
        column = np.rint(np.arctan2(y, x) * (self._angles / (2 * np.pi))).astype(np.int32) % self._angles
        room = self._sight[row, column] - np.sqrt(x * x + y * y)
        # The caecum's end is a wall too; before the anus it is open.
        return arcs, np.minimum(room, (last + 0.5) * step - arcs)
