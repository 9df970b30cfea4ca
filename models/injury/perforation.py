"""How likely a wall is torn: loads over median strengths, and the share of people whose strength is less.

Strength S of the wall under a force depends on the shape of what presses (`head_strength`, `shaft_strength`); that of
one person is S times one factor for all places, lognormal with median 1. So with r = F / S the largest over time and
places,

    P(perforation) = Phi(ln(r) / sigma),  sigma^2 = ln(1 + CV^2),

and a run needs to keep one number, r, and where it was. Gas counts alike, as pressure over that which bursts the
segment. Force and gas at one place are not added: nobody measured both together.

Contact area counts in two ways. Its shape is that of the heads that were tested: the end of a straight one, a bend of
90 degrees that lies on more wall and bears three times as much, a side. Its size is that of the device's diameter, with
which a share of the strength grows in proportion; that share is assumed. One contact is what presses on a stretch of
shaft of assumed length (`haustra.models.injury.patch`), or on one link where links are longer, which errs towards
tears; a straight head that lies with its side on the wall counts as pressing with its end, which errs so too. Nothing
is calibrated to how often patients are harmed.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import ndtr

from haustra.models.injury.numbers import injury_number

_QUARTER = math.pi / 2
TORN = 1e6
"""Load over strength of a wall that has been left through: beyond anybody's strength [1]."""


class Strength(NamedTuple):
    """What the wall of the median person bears under what presses on it: numbers, or arrays of one a world."""

    straight: Any
    """Median force that perforates it under a straight head [N]."""
    bent: Any
    """Under one bent by 90 degrees [N]."""
    sideways: Any
    """Under one bent by 180 degrees, or the side of a shaft [N]."""
    fixed: Any
    """Share of it that does not grow with the device's diameter [1]."""
    per_diameter: Any
    """What grows with it [1/m]."""
    contact_length: Any
    """Length of shaft whose load counts as one contact [m]."""

    @classmethod
    def of(cls, changed: Mapping[str, Any] | None = None) -> "Strength":
        """By the numbers of assets/numbers/injury.toml.

        Args:
            changed: numbers to take instead of those of the file, by their names behind 'injury.'.
        """
        asked = changed or {}

        def number(name: str) -> Any:
            return asked[name] if name in asked else injury_number(name)

        human, share = number("human_over_porcine"), number("size_share")
        straight, bent, side = (human * number(f"strength.{shape}") for shape in ("straight", "bent", "sideways"))
        return cls(straight, bent, side, 1 - share, share / number("head_diameter"), number("contact_length"))


MEDIAN = Strength.of()
"""By the numbers as they are."""


def deviation_of(between_persons: float) -> float:
    """Standard deviation of the logarithm of strength between people, given their coefficient of variation [1]."""
    return math.sqrt(math.log(1 + between_persons**2))


SIGMA = deviation_of(injury_number("between_persons"))
"""Standard deviation of the logarithm of strength between people."""


def head_strength(xp: Any, bend: Any, strength: Strength = MEDIAN) -> Any:
    """Median force that perforates a human colon under a head bent by so much [N].

    Straight, bent by 90 and by 180 degrees are those of the numbers; linear between them.

    Args:
        xp: numpy, jax.numpy, or what writes programs.
        bend: of the bending section [rad].
        strength: of the wall.
    """
    quarters = xp.minimum(bend / _QUARTER, 2.0)
    further = xp.maximum(quarters - 1.0, 0.0)
    straight, bent, sideways = strength[:3]
    return straight + (bent - straight) * xp.minimum(quarters, 1.0) + (sideways - bent) * further


def link_load(xp: Any, force: Any, bend: Any, of_head: Any, diameter: Any, strength: Strength = MEDIAN) -> Any:
    """Load over median strength under a link [1].

    Args:
        xp: numpy, jax.numpy, or what writes programs.
        force: of the wall on the contact around it [N] (`haustra.models.injury.patch.force_on_contact`).
        bend: of the bending section [rad].
        of_head: whether the link is of the bending section; the shaft lies on the wall with its side.
        diameter: of the device [m].
        strength: of the wall.
    """
    size = strength.fixed + strength.per_diameter * diameter
    return force / (size * xp.where(of_head, head_strength(xp, bend, strength), strength.sideways))


def worst_load(xp: Any, worst: tuple[Any, Any], load: Any, arc: Any, escaped: Any = None) -> tuple[Any, Any]:
    """The largest load over strength of a run so far [1], and the arc length where it was [m].

    A scope that has left through the wall has torn it, where it presses then, or if it does not, where it did most.

    Args:
        xp: numpy, jax.numpy, or what writes programs.
        worst: before.
        load: the largest now.
        arc: where that is.
        escaped: whether the scope has left through the wall; None where nobody looks.
    """
    most, taken = xp.maximum(worst[0], load), load > worst[0]
    if escaped is not None:
        most, taken = xp.where(escaped, TORN, most), taken | (escaped & (load > 0))
    return most, xp.where(taken, arc, worst[1])


def gas_load(pressure: Float[np.ndarray, "*places"], bursting: Float[np.ndarray, "..."]) -> Any:
    """Load over median strength of a wall under gas [1]: its pressure over that which bursts the segment [Pa]."""
    return np.maximum(pressure, 0.0) / bursting


def bursting_pressure(segment: str) -> float:
    """Gas pressure that bursts a segment of a median person's colon [Pa]; of the caecum, the weakest, where unknown."""
    known = "rectum", "sigmoid", "descending", "transverse", "ascending"
    return injury_number(f"rupture.{segment if segment in known else 'caecum'}")


def perforation_probability(load: Any, *, sigma: float = SIGMA, log: Any = np.log, share_below: Any = ndtr) -> Any:
    """Share of people whose wall is torn by the largest load over median strength of a run [1].

    Args:
        load: that load [1]: one number, or an array.
        sigma: standard deviation of the logarithm of strength between people (`deviation_of`).
        log: the natural logarithm, of the library that the array is of.
        share_below: its distribution function of the unit normal.
    """
    with np.errstate(divide="ignore"):
        deviation = log(load) / sigma
    return share_below(deviation)
