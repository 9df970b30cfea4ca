"""From the runs of a comparison to its table: each device, and each pair of devices in the same patients."""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.envs.study.compare_passage import SITES
from haustra.envs.study.compare_widths import advance_by_width

CONFIDENCE = 0.95
"""Share of such intervals that hold the true mean difference [1]."""
PAIRED = (
    "intubation",
    "reach",
    "time_s",
    "wall_force_peak_N",
    "wall_force_mean_N",
    "wall_pressure_peak_kPa",
    "wall_impulse_N_s_m",
    "colon_moved_mm",
    "mesentery_extension_mm",
    "extension_per_metre_mm_m",
    "p_perforation",
    "pain",
    "mucosa_seen",
    "work_J",
)
"""Scores whose differences are told."""


def summarise(rows: Sequence[Mapping[str, Any]], devices: Sequence[str]) -> dict[str, Any]:
    """Means of each device over the patients, and paired differences of all pairs with their intervals.

    Args:
        rows: finished runs: `device`, `patient` and the scores of `haustra.envs.study.compare.SCORES`,
            and where they are known `curves`.
        devices: names, in the order that they are told in.

    Returns:
        `devices` and `pairs`, as JSON values. A difference is the second less the first, over patients in whom both
        have the score; `low` and `high` are null where fewer than two have.
    """
    of = {name: {row["patient"]: row for row in rows if row["device"] == name} for name in devices}
    return {
        "devices": [_device(name, list(of[name].values())) for name in devices],
        "pairs": [
            _pair(first, second, score, of[first], of[second])
            for first, second in combinations(devices, 2)
            for score in PAIRED
        ],
    }


def paired_interval(differences: Float[np.ndarray, " patients"]) -> tuple[float, float | None, float | None]:
    """Mean of differences, and the ends of Student's interval about it; None for fewer than two."""
    from scipy.stats import t

    mean, count = float(np.mean(differences)), len(differences)
    if count < 2:
        return mean, None, None
    half = float(t.ppf((1 + CONFIDENCE) / 2, count - 1) * np.std(differences, ddof=1) / np.sqrt(count))
    return mean, mean - half, mean + half


def _device(name: str, rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    def mean(score: str) -> float | None:
        known = [row[score] for row in rows if row.get(score) is not None]
        return float(np.mean(known)) if known else None

    return {
        "name": name,
        "patients": len(rows),
        "intubation": mean("intubation"),
        "reach_mean": mean("reach"),
        "time_mean_s": mean("time_s"),
        "wall_force_peak_mean_N": mean("wall_force_peak_N"),
        "wall_force_mean_N": mean("wall_force_mean_N"),
        "wall_pressure_peak_mean_kPa": mean("wall_pressure_peak_kPa"),
        "wall_impulse_mean_N_s_m": mean("wall_impulse_N_s_m"),
        "colon_moved_mean_mm": mean("colon_moved_mm"),
        "mesentery_extension_mean_mm": mean("mesentery_extension_mm"),
        "extension_per_metre_mean_mm_m": mean("extension_per_metre_mm_m"),
        "p_perforation_mean": mean("p_perforation"),
        "pain_mean": mean("pain"),
        "pain_sites": dict(Counter(row["pain_site"] for row in rows)),
        "pain_by_site": {site: mean(f"pain_{site}") for site in SITES},
        "mucosa_seen_mean": mean("mucosa_seen"),
        "work_mean_J": mean("work_J"),
        "begins_mean_m": mean("begins_m"),
        "on_mesentery": bool(rows) and all(row["mesentery"] for row in rows),
        "stopped_by": dict(Counter(row["outcome"] for row in rows)),
        "advance_by_width": advance_by_width(row.get("curves", {}) for row in rows),
    }


def _pair(
    first: str, second: str, score: str, one: Mapping[str, Mapping], other: Mapping[str, Mapping]
) -> dict[str, Any]:
    both = [
        (one[name][score], other[name][score])
        for name in one
        if name in other and one[name].get(score) is not None and other[name].get(score) is not None
    ]
    found = {"first": first, "second": second, "score": score, "patients": len(both)}
    if not both:
        return {**found, "difference": None, "low": None, "high": None}
    difference, low, high = paired_interval(np.array([b - a for a, b in both], float))
    return {**found, "difference": difference, "low": low, "high": high}
