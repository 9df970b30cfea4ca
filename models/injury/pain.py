"""What hurts: tension of the wall and of the mesentery, each over that at which it is taken to be painful.

All tensions are forces per length of a sheet [N/m]:

- wall under a link, F / (pi d + 2 L): a force on the rim of the patch it lies on (`haustra.models.injury.patch`);
- wall along the colon, its axis' tension over the lumen's circumference, where it is stretched;
- wall under gas, p r (Laplace);
- mesentery, the force with which it holds a node of the axis, over the length of colon that the node stands for; what
  fixed segments have grown to is no sheet, and does not count.

Pain is the largest of them over its threshold [1]: 1 is where a colon is taken to hurt. A colon that is fixed in space
has the first and third only. Where it is painful to be stretched follows from balloons in the sigmoid; for the
mesentery it is assumed (`injury.painful_wall_tension`, `injury.painful_mesentery_tension`).
"""

import math
from typing import Any

from jaxtyping import Float

from haustra.models.injury.numbers import injury_number
from haustra.models.injury.patch import patch_rim
from haustra.models.wall import vectors
from haustra.models.wall.mesentery import Mesentery
from haustra.models.wall.moving_colon import edge_tension, hold_force
from haustra.models.wall.surroundings import hung
from haustra.models.wall.vectors import norm


def pressed_tension(force: Any, diameter: Any, length: Any) -> Any:
    """Tension of the wall [N/m] under a link of that diameter and length [m] on which it presses with a force [N]."""
    return force / patch_rim(diameter, length)


def mesentery_tension(xp: Any, place: vectors.Vector, slack: Any, hold: Any, support: Any, spacing: Any) -> Any:
    """Tension of the mesentery at a node of the axis [N/m], by `haustra.models.wall.moving_colon.hold_force`.

    Of a mesentery that hangs from its root, that of the surroundings is to be left out: they pull from elsewhere. A
    node without slack has no mesentery: it is fixed to the back wall, or to the pelvic floor.
    """
    return xp.where(slack > 0, norm(xp, hold_force(xp, place, slack, hold, support)) / spacing, 0.0)


def axial_tension(xp: Any, length: Any, rest: Any, tension: Any, pleating: Any, radius: Any) -> Any:
    """Tension of the wall along the colon [N/m], 0 where it is pleated: `edge_tension` over the circumference."""
    return xp.maximum(edge_tension(xp, length, rest, tension, pleating), 0.0) / (2 * math.pi * radius)


def pain(xp: Any, wall: Any, mesentery: Any) -> Any:
    """Pain where wall and mesentery have these tensions [N/m]; 1 is where it is taken to begin."""
    parts = wall / injury_number("painful_wall_tension"), mesentery / injury_number("painful_mesentery_tension")
    return xp.maximum(*parts)


def axis_tensions(
    xp: Any,
    own: Mesentery,
    displacement: Float[Any, "*worlds nodes _"],
    radius: Float[Any, "*any nodes"],
    time: Float[Any, "*worlds"] | float = 0.0,
) -> tuple[Float[Any, "*worlds nodes"], Float[Any, "*worlds nodes"]]:
    """Tensions of the wall along the colon behind each node of the axis, and of the mesentery at it [N/m].

    Args:
        xp: numpy or jax.numpy.
        own: the axis of one colon, or of one a world.
        displacement: poses of its nodes (`moving_colon.AxisDisplacement`), in the coordinates of `own`.
        radius: of the lumen at the nodes [m].
        time: when breath has moved what they hang on (`haustra.models.wall.surroundings`) [s].
    """
    nodes = own.nodes + displacement[..., :3]
    lengths = xp.sqrt(((nodes[..., 1:, :] - nodes[..., :-1, :]) ** 2).sum(axis=-1))
    spacing, pleating = (xp.asarray(part)[..., None] for part in (own.spacing, own.pleating))
    along = axial_tension(xp, lengths, own.lengths, own.tension, pleating, radius[..., :-1])
    place = hung(xp, own, vectors.of(displacement), xp.asarray(time))
    support = xp.where((xp.asarray(own.root) != 0).any(axis=(-2, -1))[..., None], 0.0, own.support)
    held = mesentery_tension(xp, place, own.slack, own.hold, support, spacing)
    return xp.concatenate([along, xp.zeros_like(held[..., :1])], axis=-1), held
