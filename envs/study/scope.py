"""How far a scope gets in a colon and what that takes, as a question for studies."""

import os
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from haustra.children import children, cores
from haustra.envs.control.laws import driver_settings
from haustra.envs.runs.insertion import Insertion, Trajectory, run_insertion
from haustra.envs.runs.measure.scores import score
from haustra.envs.runs.outcome import Outcome
from haustra.envs.sim.growing import growing
from haustra.envs.study.paths import with_values
from haustra.envs.study.questions import Backend, Question, Runner, one_by_one
from haustra.envs.study.sampling import conditions_of
from haustra.envs.study.study import Column, Job, Result, ScoreError, Study, Value
from haustra.errors import InvalidOptionError, InvalidStudyError
from haustra.fields import choice, number
from haustra.models.accuracy import stated_error
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import METADATA, load_colon, save_colon
from haustra.models.devices.scope.design import ScopeDesign
from haustra.models.devices.scope.files import find_design
from haustra.models.presets import MODELLING, PRESETS, find_preset
from haustra.models.scene import Scene, SceneOptions, build_scene
from haustra.models.wall.lumen_table import LumenTable, lumen_table
from haustra.models.wall.pieces.build import Method
from haustra.models.wall.pieces.folder import wall_folder, wall_of
from haustra.models.wall.pieces.store import load_wall
from haustra.provenance import Provenance

COLONS = "colons"
"""Folder of a sweep's grown colons and their walls."""
CURVE_POINTS = 80
"""Moments of a run at which its curves are given."""

_MEASURED = {
    "insertion_m": ("m", "scope past the anus at the end"),
    "push_force_peak_N": ("N", "largest push of the hand"),
    "torque_peak_Nm": ("N m", "largest torque of the hand"),
    "wall_force_peak_N": ("N", "largest resultant wall force on one link, at 50 Hz"),
    "wall_force_mean_N": ("N", "its mean over the run"),
    "scope_energy_peak_J": ("J", "largest energy stored in bending the scope"),
    "wall_energy_peak_J": ("J", "largest energy stored in pressing the wall"),
    "loop_excess_peak_m": ("m", "most scope inside beyond the colon passed"),
    "loop_writhe_peak_turns": ("turns", "how much the scope coiled at most"),
    "pull_back_shortening_m": ("m", "most scope that was pulled back while the tip stayed"),
    "steering_gap_mean_deg": ("°", "how far the tip's bend was from that steered for, mean"),
    "outside_max_mm": ("mm", "how far the scope stood outside the lumen at rest; negative inside"),
    "p_perforation": ("1", "share of people whose colon would be perforated; 1 where the scope escaped"),
    "perforation_site": ("text", "segment where that is likeliest"),
    "perforation_arc_m": ("m", "the same along the colon"),
    "bleeding_places": ("1", "places of 2 cm whose mucosa was sheared by more than an assumed threshold"),
    "pain_peak": ("1", "largest tension of wall or mesentery over that which is assumed to hurt"),
    "pain_s": ("s", "how long that was above 1"),
    "simulated_s": ("s", "time that was simulated"),
    "tip_segment_max": ("text", "segment of the colon that the tip came to"),
}
"""Taken from `haustra.envs.runs.measure.scores.score` as they are: unit, meaning."""

SCORES = (
    Column("outcome", "text", "why the run ended: completed, stuck, time_up, fully_inserted or escaped"),
    Column("reach", "1", "how far the tip came, as a share of the colon's length"),
    Column("tip_arc_max_m", "m", "the same as a length along the colon"),
    Column("push_force_mean_N", "N", "mean size of the hand's push"),
    Column("looping_s", "s", "how long any loop that has a name was there"),
    Column("escaped", "1", "1 where the scope broke through the wall, which ends the run"),
    *(Column(name, *about) for name, about in _MEASURED.items()),
)


@dataclass(frozen=True)
class ScopeStudyOptions:
    """How scopes are simulated."""

    seconds: float = number("s", 0.02, 3600.0, default=30.0)
    """Longest run [s]."""
    wall: Literal["prism", "coacd"] = "prism"
    """How the pieces of a fixed colon's wall are made."""
    timestep: float = number("s", 1e-5, 0.02, default=SceneOptions.timestep)
    """Integration step [s]."""
    preset: str = choice(*PRESETS, default="balanced")
    """How finely a scene is modelled, which costs time."""
    mesentery: bool = False
    """Let colons move on their mesentery."""
    driver: str = choice("follower", "endoscopist", default="follower")
    """Who drives; what an endoscopist asks of an assistant is left undone."""


@dataclass(frozen=True)
class Setup:
    """A scope, the scene's options and its driver, after the variables were applied."""

    design: ScopeDesign
    options: SceneOptions
    driver: Any
    """Settings of the driver."""


def build_setup(study: Study, variables: Mapping[str, float], conditions: Mapping[str, Value]) -> Setup:
    """The design with the variables applied, and how it is simulated.

    Paths: `design.*` are fields of `ScopeDesign` (`design.shaft.*.flexural_rigidity`: every section of the shaft);
    `scaled.diameter` sets the diameter and takes the wires' radius along, and mass with its square; `scene.*` are
    fields of `SceneOptions`, `driver.*` of the driver's settings; `condition.friction` replaces the condition.

    Raises:
        InvalidDesignError: when the design is impossible.
        InvalidOptionError: when an option or a condition cannot be honoured.
        InvalidStudyError: when a path is not known.
    """
    rooms, diameter, friction = _changes(study, variables)
    _require_colon(str(conditions["colon"]))
    friction = float(conditions["friction"]) if friction is None else friction
    moves, preset = bool(study.options["mesentery"]), find_preset(str(study.options["preset"]))
    options = replace(preset.apply(SceneOptions(friction=friction), law="table" if moves else None), mesentery=moves)
    if (timestep := float(study.options["timestep"])) != SceneOptions.timestep:
        options = replace(options, timestep=timestep)
    usual = driver_settings(str(study.options["driver"]), moves=moves)
    return Setup(
        design=_changed(study, rooms["design"], diameter),
        options=with_values(options, rooms["scene"]) if rooms["scene"] else options,
        driver=with_values(usual, rooms["driver"]) if rooms["driver"] else usual,
    )


def changed_design(study: Study, variables: Mapping[str, float]) -> ScopeDesign:
    """The design with the variables applied, for questions that nothing but it is varied in.

    Raises:
        InvalidDesignError: when the design is impossible.
        InvalidStudyError: when a path leads elsewhere.
    """
    rooms, diameter, friction = _changes(study, variables)
    if rooms["scene"] or rooms["driver"] or friction is not None:
        raise InvalidStudyError("Only design.<field> and scaled.diameter may be varied here")
    return _changed(study, rooms["design"], diameter)


def _changes(
    study: Study, variables: Mapping[str, float]
) -> tuple[dict[str, dict[str, float]], float | None, float | None]:
    """What paths lead to: fields by their room, the diameter and the friction, where these are given."""
    paths = {variable.name: variable.path for variable in study.variables}
    rooms: dict[str, dict[str, float]] = {"design": {}, "scene": {}, "driver": {}}
    diameter = friction = None
    for path, value in {**study.changes, **{paths[name]: value for name, value in variables.items()}}.items():
        room, _, rest = path.partition(".")
        if room in rooms and rest:
            rooms[room][rest] = value
        elif path == "scaled.diameter":
            diameter = value
        elif path == "condition.friction":
            friction = value
        else:
            raise InvalidStudyError(
                f"'{path}' is not known. Known: design.<field>, scaled.diameter, scene.<field>, driver.<field>, "
                "condition.friction"
            )
    return rooms, diameter, friction


def _changed(study: Study, fields: dict[str, float], diameter: float | None) -> ScopeDesign:
    design = find_design("adult" if study.base == "default" else study.base)
    if diameter is not None:
        design = _with_diameter(design, diameter)
    return with_values(design, fields) if fields else design


def _with_diameter(design: ScopeDesign, diameter: float) -> ScopeDesign:
    ratio = diameter / design.diameter
    return replace(
        design,
        diameter=diameter,
        mass_per_length=design.mass_per_length * ratio**2,
        wires=replace(design.wires, routing_radius=design.wires.routing_radius * ratio),
    )


def answer(study: Study, folder: Path, job: Job) -> Result:
    """Drive one scope into one colon."""
    setup = build_setup(study, job.variables, job.conditions)
    name = str(job.conditions["colon"])
    colon = _colon(folder, name)
    wall = table = None
    if setup.options.wall_law == "table":
        table = _table(folder, name, setup.design.diameter / 2, setup.options.mesentery)
    elif setup.options.wall_law == "pieces":
        wall = load_wall(wall_folder(colon_folder(folder, name), cast(Method, study.options["wall"])))
    seconds = float(study.options["seconds"])
    deepest = setup.options.start_depth + setup.driver.advance_rate * seconds
    scene = build_scene(colon, wall, setup.design, setup.options, show_lumen=False, deepest=deepest)
    run = run_insertion(
        scene, seconds=seconds, settings=setup.driver, backend=growing(wall, deepest=deepest, table=table)
    )
    if run.outcome is Outcome.DIVERGED:
        return Result(job.id, "diverged", reason=run.outcome.advice)
    return Result(job.id, "finished", scores=_scores(scene, run), curves=_curves(run.trajectory))


def _scores(scene: Scene, run: Insertion) -> dict[str, Value | None]:
    found = score(scene, run, Provenance(inputs={}, configuration={}))
    furthest, length = (cast(float, found[name]) for name in ("tip_arc_max_m", "colon_length_m"))
    loops = [cast(float, value) for name, value in found.items() if name.startswith("loop_") and name.endswith("_s")]
    return {
        "outcome": run.outcome.value,
        "reach": furthest / length,
        "tip_arc_max_m": furthest,
        "push_force_mean_N": cast(float, found["push_force_mean_N"]),
        "looping_s": float(sum(loops)),
        "escaped": float(run.outcome is Outcome.ESCAPED),
        **{name: cast(Value, found[name]) for name in _MEASURED},
    }


def _curves(recorded: Trajectory) -> dict[str, list[float]]:
    kept = np.unique(np.linspace(0, len(recorded.time) - 1, CURVE_POINTS).astype(int))
    arrays = {
        "time_s": recorded.time,
        "tip_arc_m": recorded.tip_arc,
        "insertion_m": recorded.insertion,
        "push_force_N": recorded.push_force,
        "wall_force_N": recorded.wall_force,
    }
    return {name: [float(value) for value in np.round(array[kept], 6)] for name, array in arrays.items()}


def _require_colon(name: str) -> None:
    seed = name.removeprefix("grown-")
    if seed != name and not (seed.isascii() and seed.isdecimal() and len(seed) < 19):
        raise InvalidOptionError(f"Colon '{name}' is not known: give grown-0, grown-1, … or a colon's folder.")


def colon_folder(folder: Path, name: str) -> Path:
    """Where a colon of a study is: a grown one in the study's own folder."""
    return folder / COLONS / name if name.startswith("grown-") else Path(name)


@lru_cache(maxsize=4)
def _colon(folder: Path, name: str) -> Colon:
    return load_colon(colon_folder(folder, name))


@lru_cache(maxsize=4)
def _table(folder: Path, name: str, radius: float, moves: bool) -> LumenTable:
    return lumen_table(_colon(folder, name), device_radius=radius, with_mesentery=moves)


def prepare_colons(study: Study, folder: Path, tell: Callable[[str], None]) -> None:
    """Grow the study's colons that are missing, on every core; each appears at once.

    Raises:
        HaustraError: when a colon cannot be grown.
    """
    named = {name: colon_folder(folder, name) for name in map(str, study.conditions["colon"])}
    missing = {
        name: place for name, place in named.items() if name.startswith("grown-") and not (place / METADATA).is_file()
    }
    processes = min(len(missing), cores())
    if processes < 2:
        for name, place in missing.items():
            tell(f"growing {name}")
            _grow(name, place)
        return
    tell(f"growing {len(missing)} colons")
    with children(processes) as pool:
        for grown in [pool.submit(_grow, name, place) for name, place in missing.items()]:
            grown.result()


def _grow(name: str, place: Path) -> None:
    half = place.with_name(f".{name}.{os.getpid()}")
    save_colon(grow_colon(seed=int(name.removeprefix("grown-"))), half)
    shutil.rmtree(place, ignore_errors=True)
    half.rename(place)


def prepare(study: Study, folder: Path, tell: Callable[[str], None]) -> None:
    """Grow the study's colons, and build the walls that are missing, where they stand fixed.

    Raises:
        HaustraError: when a colon cannot be grown or read, or has no wall.
    """
    prepare_colons(study, folder, tell)
    if not study.options["mesentery"]:
        for name in map(str, study.conditions["colon"]):
            place = colon_folder(folder, name)
            tell(f"wall of {place.name}")
            wall_of(place, load_colon(place), cast(Method, study.options["wall"]))


def score_errors(study: Study, backend: str) -> dict[str, ScoreError]:
    """The highest errors measured for the study's wall, preset and grown colons, as bounds of its scores.

    Forces were measured as means; of peaks, which are off by more, this is the least that can be said. What a variable
    changes in the model itself, other backends and imported colons were not measured.
    """
    modelled = {f"scene.{name}" for name in MODELLING}
    paths = {*study.changes, *(variable.path for variable in study.variables)}
    colons = [str(name) for name in study.conditions["colon"]]
    if backend != "native" or paths & modelled or not all(name.startswith("grown-") for name in colons):
        return {}
    options = build_setup(study, {}, conditions_of(study)[0]).options
    stated = stated_error(options, "grown", wall=str(study.options["wall"]))
    found: dict[str, ScoreError] = {}
    for quantity, scores in _BOUNDED.items():
        high = getattr(stated, quantity)[1]
        if high is not None:
            found |= dict.fromkeys(scores, ScoreError(relative=high))
    if (high := stated.tip_mm[1]) is not None:
        found["tip_arc_max_m"] = ScoreError(absolute=high / 1e3)
        found["reach"] = ScoreError(absolute=high / 1e3 / _SHORTEST)
    return found


_BOUNDED = {
    "wall_force": ("wall_force_mean_N", "wall_force_peak_N"),
    "push": ("push_force_mean_N", "push_force_peak_N"),
}
"""Measured errors, and the scores that they bound."""
_SHORTEST = 1.0
"""No grown colon is shorter [m] (assets/anatomy/published.csv)."""


def _start(study: Study, folder: Path) -> Runner:
    return one_by_one(lambda job: answer(study, folder, job))


QUESTION = Question(
    scores=SCORES,
    conditions={
        "colon": Column("colon", "text", "grown-<seed>, or the folder of a colon"),
        "friction": Column("friction", "1", "Coulomb's coefficient between scope and wall"),
    },
    options=ScopeStudyOptions,
    check=build_setup,
    errors=score_errors,
)
NATIVE = Backend(start=_start, prepare=prepare)
