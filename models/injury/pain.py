"""What hurts: tension of the wall and of the mesentery, each over that at which it is taken to be painful.

All tensions are forces per length of a sheet [N/m]:

- wall under a link, F / (pi d): a force spread over the rim of the device's cross-section;
- wall along the colon, its axis' tension over the lumen's circumference, where it is stretched;
- wall under gas, p r (Laplace);
- mesentery, the force with which it holds a node of the axis, over the length of colon that the node stands for.

Pain is the largest of them over its threshold [1]: 1 is where a colon is taken to hurt. A colon that is fixed in space
has the first and third only. Where it is painful to be stretched follows from balloons in the sigmoid; for the
mesentery it is assumed (`injury.painful_wall_tension`, `injury.painful_mesentery_tension`).
"""

import math
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.models.injury.numbers import injury_number
from haustra.models.wall import vectors
from haustra.models.wall.mesentery import Mesentery
from haustra.models.wall.moving_colon import edge_tension, hold_force
from haustra.models.wall.vectors import norm


def pressed_tension(force: Any, diameter: Any) -> Any:
    """Tension of the wall under a link of that diameter [m] on which it presses with a force [N]: [N/m]."""
    return force / (math.pi * diameter)


def mesentery_tension(xp: Any, place: vectors.Vector, slack: Any, hold: Any, support: Any, spacing: Any) -> Any:
    """Tension of the mesentery at a node of the axis [N/m], by `haustra.models.wall.moving_colon.hold_force`."""
    return norm(xp, hold_force(xp, place, slack, hold, support)) / spacing


def axial_tension(xp: Any, length: Any, rest: Any, tension: Any, pleating: Any, radius: Any) -> Any:
    """Tension of the wall along the colon [N/m], 0 where it is pleated: `edge_tension` over the circumference."""
    return xp.maximum(edge_tension(xp, length, rest, tension, pleating), 0.0) / (2 * math.pi * radius)


def pain(xp: Any, wall: Any, mesentery: Any) -> Any:
    """Pain where wall and mesentery have these tensions [N/m]; 1 is where it is taken to begin."""
    parts = wall / injury_number("painful_wall_tension"), mesentery / injury_number("painful_mesentery_tension")
    return xp.maximum(*parts)


def axis_tensions(
    own: Mesentery, displacement: Float[np.ndarray, "records nodes 3"], radius: Float[np.ndarray, " nodes"]
) -> tuple[Float[np.ndarray, "records nodes"], Float[np.ndarray, "records nodes"]]:
    """Tensions of the wall along the colon and of the mesentery, at each node of one colon's axis [N/m].

    The anus is held by the pelvic floor and not by a mesentery: its node has none.

    Args:
        own: the colon's axis.
        displacement: of its nodes from rest, in the coordinates of `own` [m].
        radius: of the lumen at the nodes [m].
    """
    lengths = np.linalg.norm(np.diff(own.nodes + displacement, axis=1), axis=2)
    along = (radius[1:] + radius[:-1]) / 2
    edges = axial_tension(np, lengths, own.lengths, own.tension, own.pleating, along)
    wall = np.maximum(np.pad(edges, ((0, 0), (1, 0))), np.pad(edges, ((0, 0), (0, 1))))
    held = mesentery_tension(np, vectors.of(displacement), own.slack, own.hold, own.support, own.spacing)
    held[:, 0] = 0.0
    return wall, held
