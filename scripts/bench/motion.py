"""How colons that move hold together while a scope is driven into them, and what the patient around them changes."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.linear_insertion import run_linear_insertion
from haustra.envs.runs.measure.scores import score
from haustra.envs.runs.measure.surface import left_behind
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import load_colon
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.wall.abdomen import Abdomen
from haustra.provenance import Provenance

FIRST_SEED = 300_000
"""First seed of the grown colons, which nothing was trained on."""
DESIGN = "adult"
JUDGED_EVERY = 1.0
"""Time between two surfaces that are judged [s]."""
PLAIN = "as imaged"
AROUND: Mapping[str, Abdomen] = {
    PLAIN: Abdomen(),
    "on the left side": Abdomen(posture="left"),
    "on the right side": Abdomen(posture="right"),
    "on the front": Abdomen(posture="prone"),
    "descending and ascending colon mobile": Abdomen(mobile=("descending", "ascending")),
    "sigmoid adherent": Abdomen(adhesions=("sigmoid",)),
    "a hand on the sigmoid": Abdomen(pressed="sigmoid"),
}
"""The patients that each colon is put into."""
COMPARED = {
    "tip_arc_max_m": ("reach [m]", 3),
    "push_force_mean_N": ("mean push [N]", 2),
    "loop_excess_peak_m": ("most scope beyond the colon passed [m]", 3),
    "pain_peak": ("largest pain [1]", 2),
}
"""Scores that are compared, with their words and decimals."""
_KEPT = (
    *COMPARED,
    "outcome",
    "p_perforation",
    "turned_over_max_share",
    "outside_surface_max_mm",
    "colon_moved_peak_mm",
)


def bench_motion(
    *,
    colons: int,
    seconds: float,
    others: Sequence[Path] = (),
    progress: Callable[[float, str], None] = lambda done, note: None,
) -> list[dict[str, Any]]:
    """Drive an adult scope into held-out grown colons by the lumen follower, in each of the patients `AROUND`.

    Args:
        colons: how many.
        seconds: of each run [s].
        others: folders of colons to run beside them, as imaged only.
        progress: told runs done.
    """
    rows: list[dict[str, Any]] = []
    jobs = [(grow_colon(seed=FIRST_SEED + number), AROUND) for number in range(colons)]
    jobs += [(load_colon(folder), {PLAIN: AROUND[PLAIN]}) for folder in others]
    for colon, patients in jobs:
        for name, around in patients.items():
            progress(len(rows), f"{colon.name}, {name}")
            rows.append({"colon": colon.name, "patient": name, **_run(colon, around, seconds)})
    progress(len(rows), "")
    return rows


def _run(colon: Colon, around: Abdomen, seconds: float) -> dict[str, Any]:
    options = SceneOptions(wall_law="table", mesentery=True, abdomen=around)
    scene = build_scene(colon, None, named_design(DESIGN), options, show_lumen=False)
    run = run_linear_insertion(scene, seconds=seconds, settings=FollowerSettings(straighten=True))
    left = left_behind(scene, run, records=1 + int(run.trajectory.time[-1] / JUDGED_EVERY))
    found = score(scene, run, Provenance(inputs={}, configuration={}), left=left)
    return {name: found[name] for name in _KEPT}


def soundness(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Whether surfaces held together, in all runs."""
    escaped = [row for row in rows if row["outcome"] == "escaped"]
    return {
        "runs": len(rows),
        "turned_over_max_share": max(row["turned_over_max_share"] for row in rows),
        "outside_surface_max_mm": max(row["outside_surface_max_mm"] for row in rows),
        "escaped": len(escaped),
        "escaped_unsaid": sum(row["p_perforation"] < 1 for row in escaped),
        "diverged": sum(row["outcome"] == "diverged" for row in rows),
    }


def effects(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """What each patient changes against the colon as imaged: mean over colons, and its 95 % interval (paired, t)."""
    from scipy.stats import t

    plain = {row["colon"]: row for row in rows if row["patient"] == PLAIN}
    found = []
    for name in AROUND:
        own = [row for row in rows if row["patient"] == name]
        entry: dict[str, Any] = {"patient": name}
        for key in COMPARED:
            more = np.array([row[key] - plain[row["colon"]][key] for row in own])
            half = float(t.ppf(0.975, len(more) - 1) * more.std(ddof=1) / np.sqrt(len(more))) if len(more) > 1 else 0.0
            mean = float(np.mean([row[key] for row in own]))
            entry[key] = {"mean": mean, "change": float(more.mean()), "half_interval": half}
        found.append(entry)
    return found
