"""What of the hand's pulls bends the tip: less what a bent shaft loses (`arriving_pulls`), no more than wires bear.

Where wheels steer, a wire is a spring: it pulls by what wheel and bending section stretch it. Wires come in pairs, 'up'
with 'down' and 'left' with 'right': what a wheel takes up of one it pays out of the other, and what a bend shortens the
path of one by, it lengthens that of the other.
"""

from collections.abc import Sequence
from typing import Any

from jaxtyping import Float

_TINY = 1e-24
"""Keeps the derivative of a straight joint's angle finite; less than rounding [rad^2]."""
ROUNDS = 2
"""Times that the limit of guesses of wires' pulls is taken (`sprung_pulls`). From the solution, speeds are then less
than 1e-10 away, whatever the wires' stretch."""
LARGEST_SHARE = 0.95
"""Largest share of an error that a guess is taken to leave; 0.5 is what a rigid wire round a full bend leaves."""


def sheath_angle(xp: Any, about_x: Float[Any, "*worlds joints"], about_y: Float[Any, "*worlds joints"]) -> Any:
    """Angle that shafts are bent through, summed regardless of direction [rad], from the angles of their hinges."""
    return joint_angle(xp, about_x, about_y).sum(-1)


def joint_angle(xp: Any, about_x: Any, about_y: Any) -> Any:
    """Angle that a joint of two hinges is bent through [rad]."""
    return xp.sqrt(about_x * about_x + about_y * about_y + _TINY)


def borne_pulls(xp: Any, pulls: Float[Any, "*worlds 4"], limit: Float[Any, "*any"]) -> Float[Any, "*worlds 4"]:
    """Pulls that wires bear [N]: none pushes, and none pulls with more than its limit."""
    return xp.clip(pulls, 0.0, limit)


def wheel_pulls(xp: Any, stretch: Any, *, compliance: Any, limit: Any) -> Any:
    """Pull of wires at their wheels [N].

    Args:
        xp: numpy or jax.numpy.
        stretch: of each wire [m]; where it is negative, the wire is slack.
        compliance: stretch per newton [m/N].
        limit: largest pull of a wire [N].
    """
    return xp.clip(stretch / compliance, 0.0, limit)


def yielded_pulls(xp: Any, before: Any, stretch: Any, give: Any, *, part: Any, compliance: Any, limit: Any) -> Any:
    """Pull at the bending section of wires whose pull itself takes stretch away [N].

    The law of `arriving_pulls`, T = clip(before, p H(T), H(T) / p) with H the pull at the wheels of a wire stretched by
    `stretch` - `give` T, solved for T. Since H falls with T, the bounds may be solved for one by one.

    Args:
        xp: numpy or jax.numpy.
        before: what arrived so far [N].
        stretch: of a wire that would pull nothing [m].
        give: by how much a newton shortens it [m/N]; 0 where pulls move nothing, and this is `arriving_pulls`.
        part: `passed_part`.
        compliance: stretch per newton [m/N].
        limit: largest pull of a wire [N].
    """
    pulled = wheel_pulls(xp, stretch, compliance=compliance + part * give, limit=limit) * part
    eased = wheel_pulls(xp, stretch, compliance=compliance + give / part, limit=limit) / part
    return xp.clip(before, pulled, xp.minimum(eased, limit))


def sprung_pulls(
    xp: Any,
    before: Sequence[Any],
    stretch: Sequence[Any],
    give: Sequence[Any],
    *,
    slack: Any,
    rounds: int = ROUNDS,
    **wires: Any,
) -> list[Any]:
    """Pulls of all four wires at the bending section, each with what the others take away of its stretch [N].

    Pairs are solved for in turn, which leaves r of the error, the square of what a newton of one pair does to the other
    over what both do to themselves. Of three such guesses in a row the limit of a geometric series is taken: it is the
    solution where none of the wires begins or ceases to pull, to stick or to reach its limit in between.

    Args:
        xp: numpy or jax.numpy.
        before: what arrived so far, of wires 'up', 'left', 'down', 'right' [N].
        stretch: of wires 'up' and 'left' if none pulled, slack included [m]; the opposite ones have the opposite.
        give: by how much a newton shortens them [m/N]: of 'up' itself, of the other pair, of 'left' itself.
        slack: length of wire that pulls nothing [m].
        rounds: of three guesses; with 0 the other pair goes on pulling as before.
        wires: the rest of `yielded_pulls`.
    """

    def pair(side: int, other: Any) -> tuple[Any, Any]:
        free = stretch[side] - give[1] * other
        ways = zip((side, side + 2), (free, -free), strict=True)
        first, second = (yielded_pulls(xp, before[wire], way - slack, give[2 * side], **wires) for wire, way in ways)
        return first, second

    def again(left: Any) -> Any:
        up, down = pair(0, left)
        left, right = pair(1, up - down)
        return left - right

    net = before[1] - before[3]
    for _ in range(rounds):
        one = again(net)
        two = again(one)
        left_over = xp.clip((two - one) / xp.where(one == net, 1.0, one - net), 0.0, LARGEST_SHARE)
        net = two + (two - one) * left_over / (1 - left_over)
    up, down = pair(0, net)
    left, right = pair(1, up - down)
    return [up, left, down, right]
