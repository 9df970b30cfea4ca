"""Measured force-against-speed curves that the paper's five statements allow; it prints none of their points.

The paper gives, for each surface, the RMSE between measurement and simulation over the range and at the peak, both
also as percentages. Both percentages of a surface have one base, which we read as the mean of the measurement
(docs/theory/tracked.md). With a simulated force S that does not depend on speed this fixes the measurement's mean, its
RMS distance from S, its value at 150 rpm up to a sign, and that it is largest there: a family of curves, not one.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

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


def rises_ever_less(curves: Float[np.ndarray, "curves 5"]) -> Bool[np.ndarray, " curves"]:
    """Whether curves rise to 150 rpm by less and less, as friction does that grows with a power of speed up to 1.

    The paper puts the lack of force below 150 rpm to traction and to friction that depends on speed.
    """
    slopes = np.diff(curves, axis=1) / np.diff(SPEEDS_RPM)
    return slopes[:, 1] <= slopes[:, 0]


def least_worst(*, peak_kept: bool) -> float:
    """Smallest RMSE that the form of losses which the robot has could keep against every curve of both surfaces [1].

    Over the mean of the measurement. The form is a power of speed up to 150 rpm and a linear fall beyond, the same on
    both surfaces; its level at 150 rpm is the published one, or free too.
    """
    from scipy.optimize import minimize

    curves = {surface: implied_curves(statement) for surface, statement in STATEMENTS.items()}
    rpm, peak = np.array(SPEEDS_RPM), SPEEDS_RPM[_PEAK]

    def worst(parameters: Float[np.ndarray, "3"]) -> float:
        exponent, fall, level = parameters
        share = np.minimum(1.0, rpm / peak) ** exponent * (1 - fall * np.maximum(0.0, rpm / peak - 1))
        errors = []
        for surface, statement in STATEMENTS.items():
            top = statement.simulated - statement.peak_rmse if peak_kept else level * statement.simulated
            errors.append(np.sqrt(((curves[surface] - top * share) ** 2).mean(axis=1)).max() / statement.mean)
        return max(errors)

    begin = [np.array([rise, fall, 0.93]) for rise, fall in ((0.45, 0.25), (0.3, 0.2))]
    within = {"xatol": 1e-5, "fatol": 1e-6, "maxiter": 1000}
    return min(float(minimize(worst, at, method="Nelder-Mead", options=within).fun) for at in begin)


def best_guaranteed(curves: Float[np.ndarray, "curves 5"]) -> float:
    """Smallest RMSE that any curve at all could keep against every one of these [N].

    Radius of their smallest enclosing ball, by Badoiu and Clarkson's steps (SODA 2003, p. 801): a step of 1 / (n + 1)
    towards the farthest curve; some 3000 steps come within a few percent of it.
    """
    centre = curves.mean(0)
    for number in range(2, _BALL_STEPS):
        centre = centre + (curves[np.argmax(((curves - centre) ** 2).sum(1))] - centre) / number
    return float(np.sqrt(((curves - centre) ** 2).mean(1).max()))
