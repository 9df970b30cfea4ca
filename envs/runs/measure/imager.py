"""What coordinates of a magnetic imager tell of an insertion: the same measures of clinical and simulated recordings.

A recording knows no anus and no colon. The anus is taken to be where the tip is when the endoscopy starts, so that
lengths inside lack what had been inserted by then; coils are taken to be as far apart along the scope as they are at
most seen to be (the 95th percentile of their distances over time). Between coils the scope is drawn as a cubic spline.
Insertion is judged, from the start to the first time at the caecum where the log names it, else to the end.

Loops are named by `haustra.envs.runs.measure.loops` from the spline alone, without the colon: gamma and deep transverse
loops cannot be told, and what the colon's own course makes the scope do counts as well.
"""

from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.interpolate import CubicSpline

from haustra.envs.runs.imager_files import CAECUM, HEPATIC, SPLENIC, START, ImagerRecording
from haustra.envs.runs.measure.looping import FRONT_TO_BACK
from haustra.envs.runs.measure.loops import LoopKind, find_loops, writhe
from haustra.envs.runs.measure.progression import progression_scores
from haustra.errors import InvalidOptionError

_EVERY = 0.5
"""Time between two shapes whose loops are named [s]; engineering choice, as for runs."""
_NAMED = (LoopKind.N, LoopKind.ALPHA, LoopKind.REVERSED_ALPHA)
"""Kinds of loops that can be told without the colon."""
_BETWEEN = 0.02
"""Distance between points of a shape [m]; engineering choice."""
_LEAST = 0.05
"""A scope that never gets this far in [m] is not judged; engineering choice."""


def imager_scores(recording: ImagerRecording) -> dict[str, Any]:
    """Scores of the insertion in a recording as plain JSON values, units in the names.

    `cops3d_*` are as in `haustra.envs.runs.measure.progression`, `loop_*_s` how long a loop of that name was there,
    `insertion_max_m` the most scope inside, at most the way from the tip to the last coil. `cops_landmarks` is the own
    CoPS by the log's landmarks: the tip is taken to go evenly from each to the next, and each to be at its share of a
    colon of reference lengths (`anatomy.length`); null where the log names none.

    Raises:
        InvalidOptionError: when the scope never gets in.
    """
    start = float(np.clip(recording.events.get(START, 0.0), 0.0, recording.time[-1]))
    end = recording.events.get(CAECUM, recording.time[-1])
    judged: Bool[np.ndarray, " records"] = (recording.time >= start) & (recording.time <= max(end, start))
    time, coils = recording.time[judged], recording.coils[judged]
    behind = _distances(recording.coils)
    insertion = inserted_length(coils, behind) if len(time) else np.zeros(0)
    if not len(time) or time[-1] == time[0] or insertion.max() < _LEAST:
        raise InvalidOptionError(
            f"The recording cannot be judged: within {len(time)} moments of insertion the scope never gets "
            f"{_LEAST * 100:.0f} cm in."
        )
    progress = _progress(recording, time)
    scores = progression_scores(time, coils[:, 0], coils[:, 1:], insertion, progress=progress, behind=behind[1:])
    return {
        "coils": coils.shape[1],
        "coil_spacing_m": float(np.diff(behind).mean()),
        "records": len(time),
        "seconds": float(time[-1] - time[0]),
        "reached_caecum": CAECUM in recording.events,
        "insertion_max_m": float(insertion.max()),
        "cops_landmarks": scores.pop("cops_own", None),
        **scores,
        **_loops(time, coils, behind, insertion),
    }


def inserted_length(
    coils: Float[np.ndarray, "records coils 3"], behind: Float[np.ndarray, " coils"]
) -> Float[np.ndarray, " records"]:
    """Length of scope past the place of the tip in the first record [m].

    Args:
        coils: places, the tip's first [m].
        behind: their distances from the tip along the scope [m].
    """
    first, last = coils[:, :-1], coils[:, 1:]
    ahead, away = last - first, coils[0, 0] - first
    along = (away * ahead).sum(axis=-1) / np.maximum((ahead * ahead).sum(axis=-1), 1e-12)
    along = np.clip(along, 0.0, 1.0)
    apart = np.linalg.norm(away - along[..., None] * ahead, axis=-1)
    nearest = apart.argmin(axis=1)
    rows = np.arange(len(coils))
    return behind[nearest] + along[rows, nearest] * np.diff(behind)[nearest]


def _distances(coils: Float[np.ndarray, "records coils 3"]) -> Float[np.ndarray, " coils"]:
    """Distance of each coil from the tip along the scope [m]."""
    chords = np.linalg.norm(np.diff(coils, axis=1), axis=2)
    return np.concatenate([[0.0], np.cumsum(np.percentile(chords, 95, axis=0))])


def _progress(recording: ImagerRecording, time: Float[np.ndarray, " records"]) -> Float[np.ndarray, " records"] | None:
    """Share of the colon that the tip has come by the log's landmarks [1]."""
    known = [(recording.events[name], share) for name, share in _landmark_shares().items() if name in recording.events]
    times = [time[0], *(moment for moment, _ in known)]
    if not known or any(after <= one for one, after in pairwise(times)):
        return None
    return np.interp(time, times, [0.0, *(share for _, share in known)])


def _landmark_shares() -> dict[str, float]:
    """Share of the colon's length at which each landmark lies, of segments of reference lengths [1]."""
    from haustra.assets import asset
    from haustra.quantity import load_quantities

    numbers = load_quantities(asset("numbers/anatomy.toml"))
    both = [numbers[f"anatomy.length.transverse_{sex}"].value for sex in ("female", "male")]
    named = ("rectum", "sigmoid", "descending", "ascending", "caecum")
    rectum, sigmoid, descending, ascending, caecum = (numbers[f"anatomy.length.{name}"].value for name in named)
    splenic = rectum + sigmoid + descending
    hepatic = splenic + sum(both) / 2
    whole = hepatic + ascending + caecum
    return {SPLENIC: splenic / whole, HEPATIC: hepatic / whole, CAECUM: (hepatic + ascending) / whole}


def _loops(time: np.ndarray, coils: np.ndarray, behind: np.ndarray, insertion: np.ndarray) -> dict[str, float]:
    """How long there was a loop of each name [s], and the largest writhe."""
    lasting, turns = dict.fromkeys((kind.value for kind in _NAMED), 0.0), 0.0
    moments = np.unique(np.searchsorted(time, np.arange(float(time[0]), float(time[-1]), _EVERY)))
    for moment in moments:
        inside = np.arange(float(insertion[moment]), 0.0, -_BETWEEN)
        if len(inside) < 4:
            continue
        shape = CubicSpline(behind, coils[moment])(inside)
        turns = max(turns, abs(writhe(shape)))
        for kind in {loop.kind for loop in find_loops(shape, view=FRONT_TO_BACK)}:
            lasting[kind.value] += _EVERY
    return {
        "loop_writhe_peak_turns": turns,
        **{f"loop_{name.replace(' ', '_')}_s": seconds for name, seconds in lasting.items()},
    }
