"""How colons that move hold together while a scope is driven into them, and what the patient around them changes."""

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.runs.insertion import Insertion
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.envs.runs.measure.scores import score
from haustra.envs.runs.measure.surface import LeftBehind, judged, outside_at_records, worst
from haustra.envs.sim.gas import require_room
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.state import Controls
from haustra.envs.simulate import simulate
from haustra.envs.view.picture.lens import lens_of
from haustra.envs.view.picture.renderer import CameraPose
from haustra.envs.view.picture.seen_wall import WallCheck
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import load_colon
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import Scene, SceneOptions, build_scene, entry_of
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.lumen_table import lumen_table, stack
from haustra.provenance import Provenance

FIRST_SEED = 300_000
"""First seed of the grown colons, which nothing was trained on."""
DESIGN = "adult"
DRIVERS = ("follower", "insertion")
"""The lumen follower, and the policy that ships."""
_PICTURE = 96
"""Rows and columns of the pictures from the tip that are checked [pixels]; engineering choice."""
PLAIN = "as imaged"
GAS, WATER, EVERYTHING = "gas let in up to 25 mmHg", "300 mL of that as water", "everything at once"
PATIENTS: Mapping[str, Mapping[str, Any]] = {
    PLAIN: {},
    "on the left side": {"abdomen": Abdomen(posture="left")},
    "on the right side": {"abdomen": Abdomen(posture="right")},
    "on the front": {"abdomen": Abdomen(posture="prone")},
    "descending and ascending colon mobile": {"abdomen": Abdomen(mobile=("descending", "ascending"))},
    "sigmoid adherent": {"abdomen": Abdomen(adhesions=("sigmoid",))},
    "a hand on the sigmoid": {"abdomen": Abdomen(pressed="sigmoid")},
    GAS: {"gas": 3333.0},
    WATER: {"gas": 3333.0, "water": 3e-4},
    "held in by an envelope": {"abdomen": Abdomen(envelope=True)},
    "breathing": {"abdomen": Abdomen(breathing=True)},
    "loops that touch": {"abdomen": Abdomen(loops_touch=True)},
    "all three": {"abdomen": Abdomen(envelope=True, breathing=True, loops_touch=True)},
    "a tube without torsion": {"abdomen": Abdomen(torsion=False)},
    EVERYTHING: {
        "gas": 3333.0,
        "water": 3e-4,
        "abdomen": Abdomen(
            posture="left",
            mobile=("descending", "ascending"),
            adhesions=("transverse",),
            pressed="sigmoid",
            envelope=True,
            breathing=True,
            loops_touch=True,
        ),
    },
}
"""What each colon is put into: options of the scene that differ from the usual."""
AGAINST: Mapping[str, str] = {WATER: GAS}
"""Patients that are compared with another than the colon as it was imaged: they differ from that in one thing."""
COSTLY = (
    *("a hand on the sigmoid", "held in by an envelope", "breathing", "loops that touch", "all three"),
    *(GAS, WATER, EVERYTHING),
)
"""Patients that cost a step something."""
_WORLDS, _PUSH_RATE = (1, 128), 0.02
"""Numbers of worlds whose steps are timed, and how fast scopes are pushed meanwhile [m/s]; engineering choice."""
COMPARED = {
    "tip_arc_max_m": ("reach [m]", 3),
    "push_force_mean_N": ("mean push [N]", 2),
    "loop_excess_peak_m": ("most scope beyond the colon passed [m]", 3),
    "pain_peak": ("largest pain [1]", 2),
}
"""What is compared, with its words and decimals."""
_SCORED = (
    *("tip_arc_max_m", "push_force_mean_N", "loop_excess_peak_m", "pain_peak", "outcome", "p_perforation"),
    *("turned_over_max_share", "outside_surface_max_mm", "surface_records", "outside_surface_records"),
    *("surface_judged_s", "colon_moved_peak_mm"),
)


def bench_motion(
    *,
    colons: int,
    seconds: float,
    judged_every: float,
    first_seed: int = FIRST_SEED,
    patients: Sequence[str] = (),
    drivers: Sequence[str] = DRIVERS[:1],
    others: Sequence[Path] = (),
    processes: int = 1,
    progress: Callable[[float, str], None] = lambda done, note: None,
    keep: Callable[[list[dict[str, Any]]], None] = lambda rows: None,
) -> list[dict[str, Any]]:
    """Drive an adult scope into held-out grown colons, in several of the `PATIENTS`.

    Args:
        colons: how many.
        seconds: of each run [s].
        judged_every: time between two surfaces that are judged [s].
        first_seed: of the grown colons.
        patients: names of those beside the colon as imaged; all when none are given.
        drivers: who inserts, each in turn.
        others: folders of colons to run beside them, as imaged only.
        processes: that share the colons.
        progress: told runs done.
        keep: told all rows of the colons that are done, whenever one is.

    Raises:
        InvalidOptionError: when a patient or a driver is not known.
    """
    for name, known in (*((name, PATIENTS) for name in patients), *((name, DRIVERS) for name in drivers)):
        if name not in known:
            raise InvalidOptionError(f"'{name}' is not known to this benchmark. Known: {', '.join(known)}.")
    asked = with_base(patients or tuple(PATIENTS))
    sources = [(folder, (PLAIN,)) for folder in others] + [(first_seed + number, asked) for number in range(colons)]
    jobs = [(source, driver, names) for source, names in sources for driver in drivers]
    with ProcessPoolExecutor(max(min(processes, len(jobs)), 1), mp_context=get_context("spawn")) as pool:
        given = [pool.submit(_in_patients, *job, seconds, judged_every) for job in jobs]
        rows = []
        for future in as_completed(given):
            rows += future.result()
            progress(len(rows), rows[-1]["colon"])
            keep(rows)
    return [row for future in given for row in future.result()]


def with_base(patients: Sequence[str]) -> tuple[str, ...]:
    """These patients and those that they are compared with, each once, in the order of `PATIENTS`."""
    asked = {PLAIN, *patients, *(AGAINST[name] for name in patients if name in AGAINST)}
    return tuple(name for name in PATIENTS if name in asked)


def _in_patients(
    source: int | Path, driver: str, patients: Sequence[str], seconds: float, judged_every: float
) -> list[dict[str, Any]]:
    colon = grow_colon(seed=source) if isinstance(source, int) else load_colon(source)
    asked = {"driver": driver, "seconds": seconds, "judged_every": judged_every}
    return [
        {"colon": colon.name, "patient": name, **asked, **_run(colon, PATIENTS[name], **asked)}
        for name in patients
        if _takes(colon, PATIENTS[name].get("water", 0.0))
    ]


def _takes(colon: Colon, water: float) -> bool:
    """Whether rectum and sigmoid take so much water [m^3] before a scope is in; a run with more is refused."""
    try:
        require_room(colon, water)
    except InvalidOptionError:
        return False
    return True


def _run(colon: Colon, changed: Mapping[str, Any], driver: str, seconds: float, judged_every: float) -> dict[str, Any]:
    options = SceneOptions(wall_law="table", mesentery=True, **changed)
    scene = build_scene(colon, None, named_design(DESIGN), options, show_lumen=False)
    run = simulate(scene, driver=driver, seconds=seconds)
    left, pictures = _judged(scene, run, records=1 + int(run.trajectory.time[-1] / judged_every))
    found = score(scene, run, Provenance(inputs={}, configuration={}), left=left)
    return {name: found[name] for name in _SCORED} | pictures | {"wall_clock_s": run.wall_clock}


def _judged(scene: Scene, run: Insertion, *, records: int) -> tuple[LeftBehind, dict[str, Any]]:
    """The colon as a run has left it, and what its camera saw, at the end and at the worst of the records."""
    lens = lens_of(scene.design.tip, _PICTURE, _PICTURE)
    begun, before = time.perf_counter(), RecordedRun(scene, run.trajectory, run.gas)
    outside, taken = outside_at_records(run, before), time.perf_counter() - begun
    check, figures, seen, last = WallCheck(scene.colon, lens), [], [], scene.colon
    for each in judged(scene, run, records=records, before=before):
        last = last if figures else each.colon
        figures.append(each.figures)
        seen.append(check.look(each.colon.lumen.vertices, CameraPose.of_tip(each.tip, each.tip_frame)))
    whole = worst(figures[1:] or figures, outside[:-1])
    return LeftBehind(last, worst(figures, outside), taken), {
        "turned_over_before_end_share": whole.turned_over,
        "outside_before_end_mm": 1e3 * whole.outside,
        "last_picture_mucosa_share": seen[0].mucosa,
        "last_picture_outside": seen[0].outside,
        "last_picture_across_share": seen[0].across,
        "picture_mucosa_min_share": min(each.mucosa for each in seen),
        "pictures_outside": sum(each.outside for each in seen),
        "picture_across_max_share": max(each.across for each in seen),
    }


def step_costs(
    patients: Sequence[str], *, worlds: Sequence[int] = _WORLDS, steps: int = 500, rounds: int = 15
) -> dict[str, list[float]]:
    """Processor time of a step in linear time over that of the colon as imaged, for each number of worlds.

    Scopes are pushed into the first grown colon, all patients in turn, so that whatever else a machine does counts for
    all alike; medians over rounds.

    Args:
        patients: names.
        worlds: numbers of worlds; one is in double precision, more are in single precision.
        steps: of each world in each round; fewer of many worlds.
        rounds: how often each patient has its turn.
    """
    colon, found = grow_colon(seed=FIRST_SEED), {name: list[float]() for name in patients}
    for count in worlds:
        backends = {name: _pushed(colon, PATIENTS[name], count) for name in (PLAIN, *patients)}
        at_once, still = max(steps // (1 if count == 1 else 4), 10), np.zeros(count)
        asked = Controls(still + _PUSH_RATE, still, np.zeros((count, 4)))
        took = {name: list[float]() for name in backends}
        for _ in range(rounds):
            for name, backend in backends.items():
                begun = time.process_time()
                backend.step(asked, at_once)
                took[name].append(time.process_time() - begun)
        for name in patients:
            found[name].append(float(np.median(np.array(took[name]) / np.array(took[PLAIN]))))
    return found


def _pushed(colon: Colon, changed: Mapping[str, Any], worlds: int) -> LinearBackend:
    options = SceneOptions(wall_law="table", mesentery=True, softening=worlds == 1, **changed)
    scene = build_scene(colon, None, named_design(DESIGN), options, show_lumen=False)
    own = {"device_radius": scene.cable.radius, "with_mesentery": True, "abdomen": options.abdomen}
    tables = stack([lumen_table(colon, **own).seen_from(*entry_of(colon))])
    return LinearBackend(scene, tables, worlds=worlds, real=np.float64 if worlds == 1 else np.float32)


def soundness(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Whether surfaces held together, in all of these runs; pictures of those whose pictures were checked."""
    escaped, drawn = [], []
    for row in rows:
        escaped += [row] if row["outcome"] == "escaped" else []
        drawn += [row] if "last_picture_mucosa_share" in row else []
    found = {
        "runs": len(rows),
        "turned_over_max_share": max(row["turned_over_max_share"] for row in rows),
        "turned_over_runs": sum(row["turned_over_max_share"] > 0 for row in rows),
        "outside_surface_max_mm": max(row["outside_surface_max_mm"] for row in rows),
        "outside_surface_records": [fold(map(_looked, rows)) for fold in (min, max)],
        "escaped": len(escaped),
        "escaped_unsaid": sum(row["p_perforation"] < 1 for row in escaped),
        "diverged": sum(row["outcome"] == "diverged" for row in rows),
        "pictures": len(drawn),
    }
    before = [row for row in rows if "outside_before_end_mm" in row]
    for name, key in (("turned_over_before_end", "turned_over_before_end_share"), ("outside_before_end_mm",) * 2):
        found[name] = max(row[key] for row in before) if len(before) == len(rows) else None
    if not drawn:
        return found
    return found | {
        "last_picture_mucosa_min_share": min(row["last_picture_mucosa_share"] for row in drawn),
        "last_pictures_from_outside": sum(row["last_picture_outside"] for row in drawn),
        "pictures_from_outside": sum(row["pictures_outside"] for row in drawn),
        "last_picture_across_max_share": max(row["last_picture_across_share"] for row in drawn),
        "pictures_across_runs": sum(row["picture_across_max_share"] > 0 for row in drawn),
    }


def _looked(row: Mapping[str, Any]) -> int:
    """At how many records of a run it was seen whether the scope is outside: once where triangles were looked at."""
    return row.get("outside_surface_records", row["surface_records"])


def effects(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """What each patient changes: mean over colons, and its 95 % interval (paired, t).

    Against the same colon as imaged (or as `AGAINST` says), inserted into by the same driver for as long.
    """
    from scipy.stats import t

    def alike(row: Mapping[str, Any]) -> tuple[Any, ...]:
        return row["colon"], row["driver"], row["seconds"]

    put = {alike(row) for row in rows if row["patient"] != PLAIN}
    found = []
    for name in PATIENTS:
        base = AGAINST.get(name, PLAIN)
        usual = {alike(row): row for row in rows if row["patient"] == base and alike(row) in put}
        own = [row for row in rows if row["patient"] == name and alike(row) in usual]
        if not own:
            continue
        entry: dict[str, Any] = {"patient": name, "against": base, "colons": len({row["colon"] for row in own})}
        for key in COMPARED:
            more = np.array([row[key] - usual[alike(row)][key] for row in own])
            half = float(t.ppf(0.975, len(more) - 1) * more.std(ddof=1) / np.sqrt(len(more))) if len(more) > 1 else 0.0
            mean = float(np.mean([row[key] for row in own]))
            entry[key] = {"mean": mean, "change": float(more.mean()), "half_interval": half}
        found.append(entry)
    return found
