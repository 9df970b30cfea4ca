"""What scopes do to grown colons: perforation, bleeding and pain, against what is published of patients."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.linear_insertion import run_linear_insertion
from haustra.envs.runs.measure.injury import stations_of
from haustra.envs.runs.measure.scores import score
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.devices.scope.library import named_design
from haustra.models.injury.numbers import INJURY
from haustra.models.injury.perforation import TORN, perforation_probability
from haustra.models.scene import SceneOptions, build_scene
from haustra.provenance import Provenance

FIRST_SEED = 300_000
"""First seed of the colons, which nothing was trained on."""
DESIGN = "adult"
_KEPT = (
    "outcome",
    "tip_arc_max_m",
    "colon_length_m",
    "wall_force_peak_N",
    "p_perforation",
    "perforation_site",
    "perforation_arc_m",
    "bleeding_places",
    "bleeding_by_site",
    "mucosal_shear_peak_kPa",
    "pain_peak",
    "pain_s",
    "pain_by_site",
    "cops_own",
    "cops3d_travel_length_m",
    "cops3d_tip_progression",
    "cops3d_chase_efficiency_mm",
    "cops3d_shaft_without_tip_m",
    "cops3d_looping_turns",
)
PAINFUL = (*SEGMENTS, "splenic_flexure", "hepatic_flexure")
PUBLISHED_PAIN = {
    "sigmoid": "51 % (and 77 % of demands for drugs)",
    "splenic_flexure": "25 %",
    "hepatic_flexure": "33 %",
}
"""Passages that hurt, in 58 patients (Scand J Gastroenterol 2018;53:345); demands: Shah 2002, 650 of 102 patients."""


def bench_injury(
    *, colons: int, seconds: float, progress: Callable[[float, str], None] = lambda done, note: None
) -> dict[str, Any]:
    """Drive an adult scope into held-out grown colons, on their mesentery and fixed, by the lumen follower.

    Args:
        colons: how many.
        seconds: of each run [s].
        progress: told runs done.
    """
    rows, example = [], {}
    for number in range(colons):
        seed = FIRST_SEED + number
        colon = grow_colon(seed=seed)
        for moves in (True, False):
            progress(2 * number + (not moves), f"grown {seed}")
            options = SceneOptions(wall_law="table", mesentery=moves)
            scene = build_scene(colon, None, named_design(DESIGN), options, show_lumen=False)
            run = run_linear_insertion(scene, seconds=seconds, settings=FollowerSettings(straighten=moves))
            found = score(scene, run, Provenance(inputs={}, configuration={}))
            load = float(run.trajectory.load.max(initial=0.0))
            kept = {name: found[name] for name in _KEPT}
            rows.append({"seed": seed, "mesentery": moves, "load_peak": load, **kept})
            if not example:
                seen = run.trajectory
                arrays = {"time": seen.time, "arcs": stations_of(colon), "pain": seen.pain, "pressed": seen.pressed}
                said = {name: kept[name] for name in ("perforation_arc_m", "p_perforation")}
                example = {**arrays, "segments": colon.segments, **said, "seed": seed}
    progress(2 * colons, "")
    return {"rows": rows, "example": example, "seconds": seconds}


def table(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """The figures, of colons on the mesentery and fixed, beside what is published."""
    both = [[row for row in rows if row["mesentery"] is moves] for moves in (True, False)]

    def line(figure: str, tell: Callable[[Sequence[Mapping[str, Any]]], str], published: str = "") -> dict[str, str]:
        moved, fixed = map(tell, both)
        return {"figure": figure, "on the mesentery": moved, "fixed": fixed, "patients": published}

    lines = [
        line("runs", lambda own: str(len(own))),
        line("caecum reached, or all of the scope inside", lambda own: _share(own, _arrived)),
        line("largest wall force on one link, median", lambda own: f"{_median(own, 'wall_force_peak_N'):.1f} N"),
        line("P(perforation), mean: expected share perforated", lambda own: _percent(_loads(own)), "0.016–0.2 %"),
        *(line(f"… {name}", lambda own, change=change: _percent(change(own))) for name, change in VARIANTS.items()),
        line("likeliest perforated in", _sites),
        line("ended as escaped, of these with P < 1", _escapes),
        line("places that bleed, median", lambda own: f"{_median(own, 'bleeding_places'):.0f}"),
        line("largest pain, median", lambda own: f"{_median(own, 'pain_peak'):.1f}"),
        line("time with pain above 1, median", lambda own: f"{_median(own, 'pain_s'):.0f} s"),
    ]
    for name in PAINFUL:
        lines.append(
            line(
                f"pain above 1 at the {name.replace('_', ' ')}",
                lambda own, name=name: _share(own, lambda row: row["pain_by_site"].get(name, 0.0) > 1),
                PUBLISHED_PAIN.get(name, ""),
            )
        )
    lines.append(line("rank correlation of own CoPS and largest pain", _correlation, "r = −0.47 (CoPS and VAS)"))
    return lines


def _share(rows: Sequence[Mapping[str, Any]], holds: Callable[[Mapping[str, Any]], bool]) -> str:
    return f"{sum(map(holds, rows))} of {len(rows)}"


def _arrived(row: Mapping[str, Any]) -> bool:
    return row["outcome"] in ("completed", "fully_inserted")


def _median(rows: Sequence[Mapping[str, Any]], name: str) -> float:
    return float(np.median([row[name] for row in rows]))


def _loads(rows: Sequence[Mapping[str, Any]]) -> np.ndarray:
    """Largest loads over strength; an escape is a tear."""
    return np.array([TORN if row["outcome"] == "escaped" else row["load_peak"] for row in rows])


def _percent(loads: np.ndarray) -> str:
    return f"{100 * perforation_probability(loads).mean():.2g} %"


def _over(rows: Sequence[Mapping[str, Any]], strength: str) -> np.ndarray:
    """Loads if all that presses met one of the strengths, whatever its shape; of a large head."""
    human = INJURY["injury.human_over_porcine"].value * INJURY[f"injury.strength.{strength}"].value
    forces = np.array([row["wall_force_peak_N"] for row in rows]) / human
    return np.where(_loads(rows) == TORN, TORN, forces)


VARIANTS: Mapping[str, Callable[[Sequence[Mapping[str, Any]]], np.ndarray]] = {
    "without human over porcine (1 for 1.5)": lambda rows: _loads(rows) * INJURY["injury.human_over_porcine"].value,
    "all at the lowest strength, 14.1 N": lambda rows: _over(rows, "straight"),
    "all at the highest strength, 46.5 N": lambda rows: _over(rows, "bent"),
}
"""Assumed numbers at an end of their range, and the loads that they make."""


def _sites(rows: Sequence[Mapping[str, Any]]) -> str:
    names, counts = np.unique([row["perforation_site"] for row in rows], return_counts=True)
    order = np.argsort(-counts, kind="stable")
    return ", ".join(f"{names[i]} {counts[i]}" for i in order)


def _escapes(rows: Sequence[Mapping[str, Any]]) -> str:
    escaped = [row for row in rows if row["outcome"] == "escaped"]
    return f"{len(escaped)}, {sum(row['p_perforation'] < 1 for row in escaped)}"


def _correlation(rows: Sequence[Mapping[str, Any]]) -> str:
    score, hurts = (np.argsort(np.argsort([row[name] for row in rows])) for name in ("cops_own", "pain_peak"))
    return f"{np.corrcoef(score, hurts)[0, 1]:+.2f}" if len(rows) > 2 else "too few"
