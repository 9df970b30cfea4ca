"""What of the hand's pulls bends the tip: less what a bent shaft loses (`arriving_pulls`), no more than wires bear."""

from typing import Any

from jaxtyping import Float

_TINY = 1e-24
"""Keeps the derivative of a straight joint's angle finite; less than rounding [rad^2]."""


def sheath_angle(xp: Any, about_x: Float[Any, "*worlds joints"], about_y: Float[Any, "*worlds joints"]) -> Any:
    """Angle that shafts are bent through, summed regardless of direction [rad], from the angles of their hinges."""
    return joint_angle(xp, about_x, about_y).sum(-1)


def joint_angle(xp: Any, about_x: Any, about_y: Any) -> Any:
    """Angle that a joint of two hinges is bent through [rad]."""
    return xp.sqrt(about_x * about_x + about_y * about_y + _TINY)


def borne_pulls(xp: Any, pulls: Float[Any, "*worlds 4"], limit: Float[Any, "*any"]) -> Float[Any, "*worlds 4"]:
    """Pulls that wires bear [N]: none pushes, and none pulls with more than its limit."""
    return xp.clip(pulls, 0.0, limit)
