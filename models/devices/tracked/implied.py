"""Measured force-against-speed curves that the paper's five statements allow; it prints none of their points.

The paper gives, for each surface, the RMSE between measurement and simulation over the range and at the peak, both
also as percentages. Both percentages of a surface have one base, which we read as the mean of the measurement
(docs/theory/tracked.md). With a simulated force S that does not depend on speed this fixes the measurement's mean, its
RMS distance from S, its value at 150 rpm up to a sign, and that it is largest there: a family of curves, not one.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

SPEEDS_RPM = (75.0, 120.0, 150.0, 200.0, 300.0)
"""Published."""
_PEAK = SPEEDS_RPM.index(150.0)
_BALL_STEPS = 3000
_TRIALS = 20000
"""Random directions tried; some percent of them rise to 150 rpm and fall beyond."""


@dataclass(frozen=True)
class Statement:
    """What the paper says of one surface."""

    friction: float
    simulated: float
    """S [N]: "~3 N", "~1.5 N"."""
    rmse: float
    """Over the range [N]."""
    rmse_percent: float
    peak_rmse: float
    """At the optimal speed [N]."""
    peak_percent: float

    @property
    def mean(self) -> float:
        """Base of the percentages: the measurement's mean [N]."""
        return self.rmse / (self.rmse_percent / 100)


STATEMENTS = {
    "tissue": Statement(0.4, 3.0, 0.703, 29.6, 0.162, 6.8),
    "plastic": Statement(0.2, 1.5, 0.313, 25.8, 0.092, 7.6),
}


def implied_curves(statement: Statement, seed: int = 0) -> Float[np.ndarray, "curves 5"]:
    """Curves over `SPEEDS_RPM` that agree with a statement and rise to 150 rpm and fall beyond [N].

    Four free values with given sum and sum of squares lie on a sphere in three dimensions; both signs at the peak.
    """
    draw = np.random.default_rng(seed)
    found = []
    for sign in (-1.0, 1.0):
        peak = statement.simulated + sign * statement.peak_rmse
        centre = (5 * statement.mean - peak) / 4
        square = 5 * statement.rmse**2 - statement.peak_rmse**2 - 4 * (centre - statement.simulated) ** 2
        if square <= 0:
            continue
        direction = draw.normal(size=(_TRIALS, 4))
        direction -= direction.mean(1, keepdims=True)
        others = centre + np.sqrt(square) * direction / np.linalg.norm(direction, axis=1, keepdims=True)
        curves = np.insert(others, _PEAK, peak, axis=1)
        slopes = np.diff(curves, axis=1) * np.array([1, 1, -1, -1])
        found.append(curves[(slopes >= 0).all(1) & (curves > 0).all(1)])
    return np.concatenate(found)


def best_guaranteed(curves: Float[np.ndarray, "curves 5"]) -> float:
    """Smallest RMSE that any curve at all could keep against every one of these [N].

    Radius of their smallest enclosing ball, by Badoiu and Clarkson's steps (SODA 2003, p. 801): a step of 1 / (n + 1)
    towards the farthest curve; some 3000 steps come within a few percent of it.
    """
    centre = curves.mean(0)
    for number in range(2, _BALL_STEPS):
        centre = centre + (curves[np.argmax(((curves - centre) ** 2).sum(1))] - centre) / number
    return float(np.sqrt(((curves - centre) ** 2).mean(1).max()))
