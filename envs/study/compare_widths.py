"""In lumens of what width a device came further, and how fast."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.models.anatomy.colon import Colon

BAND = 0.010
"""Width of a band of lumen widths [m]; engineering choice: a fourth of a usual lumen."""
_NAMES = "band_from_mm", "band_gained_m", "band_s"


def passed_bands(
    colon: Colon, time: Float[np.ndarray, " records"], arcs: Float[np.ndarray, " records"]
) -> dict[str, list[float]]:
    """What a tip gained, and how long it was, in lumens of each width, as `band_from_mm`, `band_gained_m`, `band_s`.

    A lumen is as wide as twice its median distance from the centreline, at rest. A metre counts once: where the tip
    had been before it gains nothing.

    Args:
        colon: at rest.
        time: of each record, evenly spaced [s].
        arcs: arc length of the tip then [m].
    """
    line = colon.centreline.arc
    furthest = np.maximum.accumulate(np.concatenate([arcs[:1], arcs]))
    width = 2 * np.interp(arcs, line, np.median(colon.radius, axis=1))
    band = (width / BAND).astype(int)
    gained, spent = (np.bincount(band, weights) for weights in (np.diff(furthest), np.full(len(arcs), float(time[0]))))
    met = np.flatnonzero(spent)
    rows = 1e3 * BAND * met, gained[met], spent[met]
    return {name: values.round(6).tolist() for name, values in zip(_NAMES, rows, strict=True)}


def advance_by_width(runs: Iterable[Mapping[str, Sequence[float]]]) -> list[dict[str, Any]]:
    """The bands of several runs together: `from_mm`, `to_mm`, `gained_m`, `seconds` and `speed_mm_s` of each."""
    sums: dict[float, np.ndarray] = {}
    for run in runs:
        for low, gained, spent in zip(*(run.get(name, ()) for name in _NAMES), strict=True):
            sums[low] = sums.get(low, np.zeros(2)) + np.array([gained, spent])
    return [
        {
            "from_mm": low,
            "to_mm": low + 1e3 * BAND,
            "gained_m": float(gained),
            "seconds": float(spent),
            "speed_mm_s": float(1e3 * gained / spent),
        }
        for low, (gained, spent) in sorted(sums.items())
    ]
