"""How sure a figure from few episodes or patients is."""

import math

import numpy as np
from jaxtyping import Float

NORMAL_QUANTILE = 1.96
"""Two-sided, 95 %."""
_RESAMPLES = 2000


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Interval of a share, 95 % (Wilson 1927, J Am Stat Assoc 22:209); for independent trials."""
    if trials == 0:
        return 0.0, 1.0
    z, share = NORMAL_QUANTILE, successes / trials
    middle = share + z * z / (2 * trials)
    spread = z * math.sqrt(share * (1 - share) / trials + z * z / (4 * trials * trials))
    scale = 1 + z * z / trials
    return max(0.0, (middle - spread) / scale), min(1.0, (middle + spread) / scale)


def bootstrap(values: Float[np.ndarray, "colons episodes"], *, seed: int = 0) -> tuple[float, float]:
    """Interval of the mean, 95 %, drawing whole colons anew: episodes in one colon are alike."""
    return mean_interval(values.mean(axis=1), seed=seed)


def mean_interval(
    values: Float[np.ndarray, " units"], *, resamples: int = _RESAMPLES, seed: int = 0
) -> tuple[float, float]:
    """Interval of the mean, 95 %, by percentile bootstrap: what is drawn anew are units that are independent.

    Args:
        values: one a colon, or one a patient.
        resamples: how often they are drawn anew.
        seed: of what is drawn.
    """
    drawn = np.random.default_rng(seed).integers(0, len(values), (resamples, len(values)))
    low, high = np.percentile(values[drawn].mean(axis=1), [2.5, 97.5])
    return float(low), float(high)
