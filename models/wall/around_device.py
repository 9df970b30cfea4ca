"""The surface of a colon that has moved, around the device in it: no triangle turned over, no place outside if it can.

The wall is drawn off the device (`haustra.models.wall.indentation`), and what turned over by that, or as the colon
moved, buckles (`haustra.models.wall.unfolding`). Corners that go aside may take a triangle across the device again:
both are then done in turn, and the wall drawn further off each time, until the device's axis is within.
"""

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Colon, Surface
from haustra.models.anatomy.winding import winding_numbers
from haustra.models.wall.indentation import indented
from haustra.models.wall.unfolding import facing_out, unfolded

WITHIN = 0.5
"""Points that a surface winds around at least so often are within it [1]."""
APART = 0.005
"""Distance between places of the device that are looked at [m]; engineering choice."""
TURNS = 6
"""How often the wall is drawn off and buckles, at most; engineering choice, more than real colons were seen to need."""
FURTHER = 0.25
"""By how much of the device's radius it is drawn further off each time [1]; engineering choice."""


def around_device(
    rest: Colon,
    now: Colon,
    arcs: Float[np.ndarray, " vertices"],
    path: Float[np.ndarray, "nodes 3"],
    *,
    radius: float,
) -> Colon:
    """A colon that has moved, its wall out of a device's way and no triangle turned over that was not at rest.

    Args:
        rest: the colon at rest.
        now: the same colon now.
        arcs: arc length of each vertex [m].
        path: the device's axis past the anus, from there to the tip [m].
        radius: of the device [m].
    """
    pressed = indented(now, arcs, path, radius=radius)
    if not (facing_out(rest, arcs) & ~facing_out(pressed, arcs)).any():
        return pressed
    found = unfolded(rest, pressed, arcs)
    for turn in range(1, TURNS):
        if not len(places_outside(found.lumen, path)):
            break
        pressed = indented(found, arcs, path, radius=(1 + FURTHER * turn) * radius)
        found = unfolded(rest, pressed, arcs)
    return found


def places_outside(lumen: Surface, path: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "places 3"]:
    """Places of a device's axis past the anus that are outside a surface [m], by winding numbers.

    Args:
        lumen: the surface.
        path: the device's axis [m].
    """
    if len(path) < 2:
        return np.zeros((0, 3))
    behind = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    own = np.linspace(0.0, behind[-1], int(np.ceil(behind[-1] / APART)) + 1)
    places = np.column_stack([np.interp(own, behind, path[:, axis]) for axis in range(3)])
    return places[winding_numbers(lumen, places) < WITHIN]
