"""How smoothly a scope went in, told from its shape alone: what a magnetic imager's coils would show.

Named after two published scores whose formulas are not public. The colonoscopy progression score (CoPS; Nerup 2017)
is high where progression is rapid and smooth, and went with less pain (r = -0.47, n = 58, Scand J Gastroenterol
2018;53:345). The 3D score (3D-CoPS, Endosc Int Open 2022, doi 10.1055/a-1132-5259) is made of five measures of coil
coordinates, of which the experts had less of travel, progression, chase and looping, and more of shaft movement without
the tip. All definitions here are this project's own, made so that they point the same way:

- CoPS: mean over the run of the way that the tip has come, in percent of the colon's length;
- travel length: path of the tip;
- tip progression: that path over the longest scope inside, 1 where the tip only goes ahead;
- chase efficiency: mean distance of the coils inside from the path that the tip has made so far;
- shaft movement without tip progression: path of the hand in times when the tip moves less than half as far;
- looping: mean over the run of the size of the writhe of tip and coils inside.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from haustra.envs.runs.measure.loops import writhe
from haustra.envs.sim.coils import COIL_DISTANCES

INTERVAL = 0.1
"""Time between two pictures of the imager [s]; engineering choice."""
_STILL = 0.5
"""A tip that moves less than this share of what the shaft moves by makes no progress [1]; engineering choice."""


def progression_scores(
    time: Float[np.ndarray, " records"],
    tip: Float[np.ndarray, "records 3"],
    coils: Float[np.ndarray, "records coils 3"],
    insertion: Float[np.ndarray, " records"],
    *,
    progress: Float[np.ndarray, " records"] | None,
    behind: Sequence[float] | Float[np.ndarray, " coils"] = COIL_DISTANCES,
) -> dict[str, float]:
    """Own CoPS and measures of 3D-CoPS of a run; all 0 of one without records.

    Args:
        time: [s].
        tip: its place [m].
        coils: places of the coils [m].
        insertion: length of scope past the anus [m].
        progress: arc length of the tip over the colon's length [1]; the own CoPS is left out where it is not known.
        behind: distance of each coil from the tip along the scope [m].
    """
    if not len(time):
        return dict.fromkeys((_COPS, *_NAMES), 0.0)
    step = float(time[-1] - time[0]) / (len(time) - 1) if len(time) > 1 else INTERVAL
    stride = max(1, round(INTERVAL / step))
    tip, coils, inserted = tip[::stride], coils[::stride], insertion[::stride]
    inside = np.array(behind) < inserted[:, None]
    moved = np.linalg.norm(np.diff(tip, axis=0), axis=1)
    pushed = np.abs(np.diff(inserted))
    travel = float(moved.sum())
    cops = {} if progress is None else {_COPS: 100 * float(np.clip(progress, 0.0, 1.0).mean())}
    found = (
        travel,
        travel / float(inserted.max()),
        1e3 * _mean([_from_path(coils[i][inside[i]], tip[: i + 1]) for i in range(len(tip)) if inside[i].any()]),
        float(pushed[moved < _STILL * pushed].sum()),
        _mean([abs(writhe(np.vstack([tip[i], coils[i][inside[i]]]))) for i in range(len(tip))]),
    )
    return cops | dict(zip(_NAMES, found, strict=True))


_COPS = "cops_own"
_NAMES = (
    "cops3d_travel_length_m",
    "cops3d_tip_progression",
    "cops3d_chase_efficiency_mm",
    "cops3d_shaft_without_tip_m",
    "cops3d_looping_turns",
)


def _from_path(points: Float[np.ndarray, "points 3"], path: Float[np.ndarray, "places 3"]) -> float:
    """Mean distance of points from the nearest place of a path [m]."""
    away = np.linalg.norm(points[:, None] - path[None], axis=2)
    return float(away.min(axis=1).mean())


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else 0.0
