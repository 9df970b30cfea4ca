"""How sure a figure from few episodes is."""

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
    random = np.random.default_rng(seed)
    means = values.mean(axis=1)
    drawn = means[random.integers(0, len(means), (_RESAMPLES, len(means)))].mean(axis=1)
    low, high = np.percentile(drawn, [2.5, 97.5])
    return float(low), float(high)
