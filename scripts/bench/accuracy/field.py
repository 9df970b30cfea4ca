"""Question: does a scope in linear time, against a table of the lumen, do what it does in MuJoCo against convex pieces?

Asked in ten grown colons, twice. Under one script of hand and wires, step by step: what the tables' wall changes. And
with the lumen follower at the wheels of each backend, where small differences grow: whether the scores of an insertion
are the same on average. Tangent planes of the surface itself say which of the two is right where they differ.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.insertion import Insertion, run_insertion
from haustra.envs.sim.growing import growing
from haustra.envs.sim.linear.single import LinearSingle
from haustra.models.devices.scope.files import find_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.scripts.bench.accuracy.drive import Errors, compare, record_script, replay
from haustra.scripts.bench.accuracy.places import Place, grown
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.result import Criterion, Table, Value, equivalence, mean_interval

COLONS = 10
"""Grown from seeds 0, 1, 2, ..."""

TIP_TOLERANCE = 3.0
"""Median distance of the tips [mm], median over colons: walls of pieces stand up to 0.7 mm off the lumen (95 %), and a
scope slips off a fold a little earlier or later; engineering choice."""

FORCE_TOLERANCE = 0.1
"""Mean push and mean sum of wall forces, relative, median over colons; and means of the follower's scores, of which
the whole 95 % interval has to lie within; engineering choice."""

PIECES_PUSH, PIECES_WALL = 0.05, 0.1
"""Mean push and mean sum of wall forces of pieces against planes, relative, mean over colons; engineering choice."""

_SCORES: Mapping[str, str] = {"furthest": "m", "push_mean": "N", "push_peak": "N", "wall_mean": "N"}


def answer(effort: Effort) -> Answer:
    """Ask in every colon."""
    seconds, driven = (4.0, 4.0) if effort.quick else (10.0, 30.0)
    paths, scores = [], []
    for seed in range(2 if effort.quick else COLONS):
        place = grown(effort, seed)
        effort.tell(f"colon {seed}: one script")
        paths.append({"colon": seed} | _one_script(place, seconds))
        effort.tell(f"colon {seed}: the follower in both")
        scores.append({"colon": seed} | _both_driven(place, driven))
    tables = (
        Table(
            "One script, ten colons" if not effort.quick else "One script, two colons",
            tuple(paths),
            "Field: the same joints against the table of the lumen, in linear time. Pieces: prisms to 0.8 mm, in "
            "MuJoCo. Planes: exact, in MuJoCo.",
        ),
        Table(f"The follower drives each backend for {driven:g} s", tuple(scores)),
        Table("Differences of scores, field less pieces", tuple(_difference(scores, name) for name in _SCORES)),
    )
    return Answer(
        tables=tables, criteria=_criteria(paths, scores), notes=[_NOTE.format(colons=len(paths), seconds=seconds)]
    )


_NOTE = (
    "Field against pieces: {colons} grown colons, adult scope, friction 0.1; {seconds:g} s of one script, recorded in "
    "tangent planes. The tolerances, 3 mm and 10 %, are engineering choices made before measuring."
)


def _one_script(place: Place, seconds: float) -> dict[str, Value]:
    colon, design, options = place.colon, find_design("adult"), SceneOptions()
    exact = replace(options, wall_law="planes")
    script = record_script(colon, design, exact, seconds=seconds)
    planes = replay(script, colon, None, design, exact)
    pieces = replay(script, colon, place.wall("prism"), design, options)
    field = replay(script, colon, None, design, replace(options, wall_law="table", softening=False))
    found: dict[str, Value] = {"inserted_m": float(planes.insertion[-1])}
    for name, errors in (
        ("field_against_pieces", compare(field, pieces)),
        ("field_against_planes", compare(field, planes)),
        ("pieces_against_planes", compare(pieces, planes)),
    ):
        found |= _named(name, errors)
    return found


def _named(name: str, errors: Errors) -> dict[str, Value]:
    return {f"{name}_tip_mm": errors.tip * 1e3, f"{name}_push": errors.push, f"{name}_wall": errors.wall}


def _both_driven(place: Place, seconds: float) -> dict[str, Value]:
    colon, design, wall = place.colon, find_design("adult"), place.wall("prism")
    deepest = SceneOptions.start_depth + FollowerSettings.advance_rate * seconds
    pieces = build_scene(colon, wall, design, show_lumen=False, deepest=deepest)
    field = build_scene(
        colon, None, design, SceneOptions(wall_law="table", softening=False), show_lumen=False, deepest=deepest
    )
    runs = {
        "pieces": run_insertion(pieces, seconds=seconds, backend=growing(wall, deepest=deepest)),
        "field": run_insertion(field, seconds=seconds, backend=LinearSingle),
    }
    found: dict[str, Value] = {}
    for name, run in runs.items():
        found |= {f"{name}_{score}": value for score, value in _scores(run).items()}
        found[f"{name}_outcome"] = run.outcome.value
    return found


def _scores(run: Insertion) -> dict[str, float]:
    seen = run.trajectory
    return {
        "furthest": float(seen.tip_arc.max()),
        "push_mean": float(seen.push_force.mean()),
        "push_peak": float(seen.push_force.max()),
        "wall_mean": float(seen.wall_force.mean()),
    }


def _difference(rows: list[dict[str, Value]], score: str) -> dict[str, Value]:
    """Mean of the paired differences, and Student's 95 % interval."""
    gap, pieces = _gaps(rows, score)
    mean, low, high = mean_interval(gap)
    return {
        "score": f"{score} [{_SCORES[score]}]",
        "pieces_mean": float(pieces.mean()),
        "field_mean": float((pieces + gap).mean()),
        "difference": mean,
        "interval_low": low if np.isfinite(low) else None,
        "interval_high": high if np.isfinite(high) else None,
    }


def _gaps(rows: list[dict[str, Value]], score: str) -> tuple[np.ndarray, np.ndarray]:
    """Field less pieces, and pieces, colon by colon."""
    pieces, field = (np.array([row[f"{name}_{score}"] for row in rows], float) for name in ("pieces", "field"))
    return field - pieces, pieces


def _criteria(paths: list[dict[str, Value]], scores: list[dict[str, Value]]) -> tuple[Criterion, ...]:
    def median(name: str) -> float:
        return float(np.median([float(row[name] or 0.0) for row in paths]))

    found = []
    for other, what in (("planes", "exact planes"), ("pieces", "pieces")):
        of = f"field_against_{other}"
        found += [
            Criterion(
                f"Field against {what}, tips under one script", median(f"{of}_tip_mm"), TIP_TOLERANCE, "mm", "at most"
            ),
            Criterion(f"Field against {what}, mean push", median(f"{of}_push"), FORCE_TOLERANCE, "1", "at most"),
            Criterion(f"Field against {what}, mean wall force", median(f"{of}_wall"), FORCE_TOLERANCE, "1", "at most"),
        ]
    for name, most in (("push", PIECES_PUSH), ("wall", PIECES_WALL)):
        mean = float(np.mean([float(row[f"pieces_against_planes_{name}"] or 0.0) for row in paths]))
        found.append(Criterion(f"Pieces against exact planes, mean {name}, mean of colons", mean, most, "1", "at most"))
    for score in _SCORES:
        gap, pieces = _gaps(scores, score)
        what = f"Field against pieces, mean {score} of an insertion"
        found.append(equivalence(what, gap / pieces.mean(), tolerance=FORCE_TOLERANCE, unit="1"))
    return tuple(found)
