"""What is trailed through a bent lumen: tension by friction, weight and every bend that it lies round.

Along the arc length u from the anus the tension grows as on a capstan, and by friction under the weight w per length,

    dT/du = mu (w + T dtheta/du),

so that with the tension T0 that it is paid out with outside

    T(s) = T0 exp(mu theta(s)) + mu w integral of exp(mu (theta(s) - theta(u))) du.

The capstan's law was confirmed for tethers that are drawn through a colon (Ortega Alcaide 2020). Theta is the turning
of the lumen's axis: a tether that is drawn taut lies in the insides of bends, and turns by no more.
"""

from types import ModuleType
from typing import Any

from jaxtyping import Float

from haustra.models.wall.abdomen import FALL


def tether_tension(
    xp: ModuleType,
    bends: Float[Any, "worlds places"],
    length: Float[Any, " worlds"],
    *,
    friction: float,
    mass_per_length: float = 0.0,
    held: float = 0.0,
) -> Float[Any, " worlds"]:
    """Tension at the inner end of a tether that is drawn in [N].

    Args:
        xp: numpy or jax.numpy.
        bends: angle that it has turned through at places evenly spaced from the anus to its inner end [rad].
        length: of the tether inside [m]; before the anus it is 0.
        friction: Coulomb's coefficient between tether and wall [1].
        mass_per_length: its mass per length, whose weight presses it on the wall [kg/m].
        held: tension outside the patient [N].
    """
    grown = xp.exp(friction * (bends[:, -1:] - bends))
    dragged = (grown[:, :-1] + grown[:, 1:]).sum(axis=1) / (2 * (bends.shape[1] - 1))
    return held * grown[:, 0] + friction * (mass_per_length * FALL) * xp.maximum(length, 0.0) * dragged
