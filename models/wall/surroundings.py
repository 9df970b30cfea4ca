"""What lies around a colon that moves, as its nodes feel it: an envelope that holds it in, and breath that moves it.

The envelope stands for the abdominal wall and the organs: six flat walls about the colon at rest, across the patient's
own directions, each of which presses back on nodes that have come further than their room. A hand on the belly presses
the front one in over some of them. Breath moves what the colon hangs on, and the wall at the head, towards the feet and
back. A colon at rest has room to every wall that no hand presses in, and time begins where nobody has breathed in.
"""

import math
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from haustra.models.wall.vectors import Vector, add, dot, of, times, where

SIDES = ("right", "front", "feet", "left", "back", "head")
"""Where the envelope's walls stand, in the order of all that is told of each: against the patient's directions (to the
left, to the back, to the head), and then along them."""
UNBOUND = 1e3
"""Room of a node that no wall is to reach [m]; engineering choice: far beyond any patient."""


def breath(xp: Any, rate: Any, time: Any) -> Any:
    """How much of the breath is in at a time [s], at so many breaths a second: from 0, where it begins, to 1."""
    return 0.5 - 0.5 * xp.cos(2 * math.pi * rate * time)


def pressed_in(xp: Any, along: Any, room: tuple[Any, Any]) -> tuple[Any, Any]:
    """How far walls at either side are pressed in [m] by what has moved so far along a direction [m].

    Args:
        xp: numpy or jax.numpy.
        along: how far [m].
        room: against the direction, and along it [m].
    """
    return xp.maximum(-along - room[0], 0.0), xp.maximum(along - room[1], 0.0)


def envelope_force(
    xp: Any, place: Vector, body: tuple[Vector, Vector, Vector], room: Any, walls: tuple[Any, Any], breathed: Any
) -> tuple[Vector, Any]:
    """Force of the envelope on a node [N], and a bound of its stiffness in any direction [N/m].

    Args:
        xp: numpy or jax.numpy.
        place: displacement of the node from rest [m].
        body: the patient's directions.
        room: of the node to each of the `SIDES` at rest [m].
        walls: stiffness of the wall at the front, and of all others [N/m].
        breathed: how far breath has moved the wall at the head [m].
    """
    front, firm = walls
    right, left = pressed_in(xp, dot(body[0], place), (room[0], room[3]))
    ahead, back = pressed_in(xp, dot(body[1], place), (room[1], room[4]))
    feet, head = pressed_in(xp, dot(body[2], place), (room[2], room[5] - breathed))
    across, up = times(firm * (right - left), body[0]), times(firm * (feet - head), body[2])
    force = add(add(across, times(front * ahead - firm * back, body[1])), up)
    pressed = where(xp, ahead > 0, front, 0.0) + where(xp, back > 0, firm, 0.0)
    pressed = pressed + where(xp, right + left > 0, firm, 0.0) + where(xp, feet + head > 0, firm, 0.0)
    return force, pressed


def envelope_energy(
    xp: Any, place: Vector, body: tuple[Vector, Vector, Vector], room: Any, walls: tuple[Any, Any], breathed: Any
) -> Any:
    """Energy of `envelope_force` [J]."""
    front, firm = walls
    right, left = pressed_in(xp, dot(body[0], place), (room[0], room[3]))
    ahead, back = pressed_in(xp, dot(body[1], place), (room[1], room[4]))
    feet, head = pressed_in(xp, dot(body[2], place), (room[2], room[5] - breathed))
    return 0.5 * front * ahead**2 + 0.5 * firm * (right**2 + left**2 + back**2 + feet**2 + head**2)


def hung(xp: Any, own: Any, place: Vector, time: Any) -> Vector:
    """How far nodes of axes are from what they hang on, which may be a root, and breath moves [m].

    Args:
        xp: numpy or jax.numpy.
        own: `haustra.models.wall.mesentery.Mesentery` of one colon, or of one a world.
        place: displacement of the nodes (worlds, nodes) [m].
        time: of each world (worlds,) [s].
    """
    drawn = breath(xp, xp.asarray(own.breaths)[..., 1], time)[..., None]
    head = xp.asarray(own.body)[..., 2, None, :]
    place = add(place, of(own.root))
    return add(place, times(drawn * own.sway, (head[..., 0], head[..., 1], head[..., 2])))


PARTS = (breath, pressed_in, envelope_force)
"""What numba is to compile."""


def rooms(
    nodes: Float[np.ndarray, "nodes 3"], outer: Float[np.ndarray, " nodes"], margin: float
) -> Float[np.ndarray, "nodes sides"]:
    """Room of each node to the walls of an envelope that stands so far from the whole colon at rest [m].

    Args:
        nodes: places at rest, in the patient's coordinates [m].
        outer: from the axis to the outside of the wall [m].
        margin: between colon and envelope [m].
    """
    both = [sign * nodes + outer[:, None] for sign in (-1, 1)]
    return np.hstack([each.max(axis=0) - each for each in both]) + margin


def under_hand(
    room: Float[np.ndarray, "nodes sides"],
    pressed: Bool[np.ndarray, " nodes"],
    hand: float,
    front: float,
    *,
    envelope: bool,
) -> Float[np.ndarray, "nodes sides"]:
    """Rooms of nodes where an assistant's hand presses the belly in [m].

    A hand moves the belly's wall in until the wall bears it, by hand / (stiffness of the wall under it). What lies
    there at rest bears all of the hand; what has gone back as far, nothing.

    Args:
        room: without a hand [m].
        pressed: which nodes lie under the hand.
        hand: force of the hand [N].
        front: stiffness of the belly's wall for a node [N/m].
        envelope: whether there are walls elsewhere, too.
    """
    left = room.copy() if envelope else np.full_like(room, UNBOUND)
    left[pressed, SIDES.index("front")] = -hand / (front * np.count_nonzero(pressed))
    return left


def swayed(nodes: Float[np.ndarray, "nodes 3"], excursion: float) -> Float[np.ndarray, " nodes"]:
    """How far a whole breath moves what each node hangs on towards the feet [m].

    As far as the diaphragm at the colon's highest node, less in proportion to height, and not at the anus or below.

    Args:
        nodes: places at rest, in the patient's coordinates [m].
        excursion: of the diaphragm [m].
    """
    above = np.maximum(nodes[:, 2] - nodes[0, 2], 0.0)
    return excursion * above / max(float(above.max()), 1e-9)
