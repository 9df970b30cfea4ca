"""How far any device gets in a colon by its own driver, as a question for studies."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from haustra.envs.runs.device_batch import run_devices
from haustra.envs.runs.device_run import common_scores, ended, reading_columns, run_device, time_is_up
from haustra.envs.runs.insertion import CONTROL_INTERVAL
from haustra.envs.runs.outcome import Outcome
from haustra.envs.study.halving import halved
from haustra.envs.study.paths import with_values
from haustra.envs.study.questions import Backend, Question, Runner, failure
from haustra.envs.study.study import Column, Job, Result, Study, Value
from haustra.errors import HaustraError, InvalidStudyError
from haustra.fields import number
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import load_colon
from haustra.models.device_scene import build_device_scene, device_options, device_tables, pose_in
from haustra.models.devices.base import Device, Pose, load_device
from haustra.models.scene import SceneOptions

TOGETHER = 4
"""Jobs in one call of the backend 'native'; engineering choice: more at once leave cores without work."""
BATCH = 1024
"""Jobs in one call of the backend 'warp'."""
_BASE = "adult"
_GROWN = "grown-"
_BANDS = ("easy", "moderate", "difficult", "hard")

SCORES = (
    Column("outcome", "text", "why the run ended: completed, stuck, time_up or escaped"),
    Column("reach", "1", "how far the tip came, as a share of the colon's length"),
    Column("tip_arc_max_m", "m", "the same as a length along the colon"),
    Column("start_m", "m", "where the tip stood at first, along the colon"),
    Column("came_m", "m", "how far the tip came from there"),
    Column("wall_force_peak_N", "N", "largest resultant wall force on one body, at 50 Hz"),
    Column("wall_force_mean_N", "N", "its mean over the run"),
    Column("outside_max_mm", "mm", "how deep the device's surface stood in the wall at rest; negative for room"),
    Column("p_perforation", "1", "share of people whose colon would be perforated; 1 where the device escaped"),
    Column("perforation_site", "text", "segment where the tip was when that was likeliest"),
    Column("perforation_arc_m", "m", "the same along the colon"),
    Column("simulated_s", "s", "time that was simulated"),
    Column("escaped", "1", "1 where the device broke through the wall, which ends the run"),
    Column("readings", "text", "means and peaks of the device's own readings, as name=value"),
)


@dataclass(frozen=True)
class DeviceStudyOptions:
    """How any device is simulated."""

    seconds: float = number("s", 0.02, 3600.0, default=30.0)
    """Longest run [s]."""
    timestep: float = number("s", 1e-5, 0.02, default=SceneOptions.timestep)
    """Integration step [s]."""
    mesentery: bool = False
    """Let colons move on their mesentery."""
    patience: float = number("s", 0.0, 3600.0, default=0.0)
    """A run that comes no further for so long is stuck, and ends [s]; 0 to wait for the end. Natively."""


def build_setup(
    study: Study, variables: Mapping[str, float], conditions: Mapping[str, Value]
) -> tuple[Device, SceneOptions]:
    """The device with the variables applied, and the options of its scene.

    Paths: `design.*` are numbers of the device, or of the design that it holds, `scene.*` of `SceneOptions`;
    `condition.friction` replaces the condition.

    Raises:
        InvalidDesignError: when the design is impossible.
        InvalidStudyError: when a path is not known.
        UnsupportedSceneError: naming what scenes of this device do not honour.
    """
    paths = {variable.name: variable.path for variable in study.variables}
    changes = {**study.changes, **{paths[name]: value for name, value in variables.items()}}
    rooms: dict[str, dict[str, float]] = {"design": {}, "scene": {}}
    friction = float(conditions["friction"])
    for path, value in changes.items():
        room, _, rest = path.partition(".")
        if room in rooms and rest:
            rooms[room][rest] = value
        elif path == "condition.friction":
            friction = value
        else:
            raise InvalidStudyError(f"'{path}' is not known. Known: design.<field>, scene.<field>, condition.friction")
    if (name := str(conditions["colon"])).startswith(_GROWN):
        _how_grown(name)
    base = load_device(_BASE if study.base == "default" else study.base)
    own = {entry.name for entry in fields(base)}
    inside = {
        path if path.partition(".")[0] in own else f"design.{path}": value for path, value in rooms["design"].items()
    }
    device = with_values(base, inside) if inside else base
    asked = {"timestep": float(study.options["timestep"]), "mesentery": bool(study.options["mesentery"])}
    options = device_options(device, friction=friction, **asked)
    options = with_values(options, rooms["scene"]) if rooms["scene"] else options
    build_device_scene(device, options, pose=Pose())
    return device, options


def result_of(
    job: Job,
    device: Device,
    outcome: Outcome,
    records: Mapping[str, np.ndarray],
    colon: Colon,
    radius: float,
    *,
    start: float,
) -> Result:
    """A job's row from what was recorded of a device with a nose of that radius [m], which was at `start` first [m]."""
    if outcome is Outcome.DIVERGED:
        return Result(job.id, "diverged", reason=outcome.advice)
    found = common_scores(outcome, records, device.readings, colon, radius)
    own = [name for reading in device.readings for name in reading_columns(reading)]
    scores: dict[str, Any] = {
        **found,
        "start_m": start,
        "came_m": found["tip_arc_max_m"] - start,
        "escaped": float(outcome is Outcome.ESCAPED),
        "readings": " ".join(f"{name}={found[name]:.6g}" for name in own),
    }
    return Result(job.id, "finished", scores={column.name: scores[column.name] for column in SCORES})


@lru_cache(maxsize=8)
def _colon(name: str) -> Colon:
    return grow_colon(**_how_grown(name)) if name.startswith(_GROWN) else load_colon(Path(name))


def _how_grown(name: str) -> dict[str, Any]:
    """What a colon is grown with: grown-<seed>, then, if wanted, its band of difficulty and its gas, -hard-2kPa.

    Raises:
        InvalidStudyError: when the name says something else.
    """
    seed, *rest = name.removeprefix(_GROWN).split("-")
    band = rest.pop(0) if rest and rest[0] in _BANDS else "any"
    gas = rest.pop(0).removesuffix("kPa") if rest and rest[0].endswith("kPa") else None
    known = seed.isascii() and seed.isdecimal() and len(seed) < 19 and not rest
    if not known or (gas is not None and not gas.replace(".", "", 1).isdecimal()):
        raise InvalidStudyError(
            f"Colon '{name}' is not known: give grown-<seed>, with its difficulty and gas as in grown-7-hard-2kPa if "
            "wanted, or a colon's folder."
        )
    return {"seed": int(seed), "difficulty": band, "pressure": None if gas is None else 1e3 * float(gas)}


def _begun(device: Device, colon: Colon, options: SceneOptions, conditions: Mapping[str, Value]) -> SceneOptions:
    """Options with the device where it stands next to the condition `start`, or where they say when there is none."""
    if "start" not in conditions:
        return options
    return replace(options, start_depth=device.nearest_start(colon, float(conditions["start"])))


def _start(study: Study, folder: Path) -> Runner:
    """Jobs of one design and friction share a batch, in which one step of many colons costs half of as many alone."""

    def run(jobs: Sequence[Job]) -> Iterable[Result]:
        groups: dict[Any, list[_Placed]] = {}
        for job in jobs:
            try:
                device, options = build_setup(study, job.variables, job.conditions)
                colon = _colon(str(job.conditions["colon"]))
                options = _begun(device, colon, options, job.conditions)
                pose_in(colon, device, options)  # refuses where it does not fit
            except MemoryError:
                raise
            except Exception as error:  # one job must not end the sweep, whatever is wrong with it
                yield failure(job, error)
                continue
            alike = tuple(sorted(job.variables.items())), options.friction
            groups.setdefault(alike, []).append(_Placed(job, device, options, colon))
        for group in groups.values():
            try:
                yield from list(_answer(group, study))
            except MemoryError:
                raise
            except Exception as error:  # one design must not end the sweep, whatever is wrong with it
                yield from (failure(one.job, error) for one in group)

    return run


class _Placed(NamedTuple):
    """A job, and what it is to be run with."""

    job: Job
    device: Device
    options: SceneOptions
    colon: Colon


def _answer(group: Sequence[_Placed], study: Study) -> Iterable[Result]:
    """Rows of jobs that have design and friction in common."""
    seconds, patience = float(study.options["seconds"]), float(study.options["patience"])
    _, device, options, _ = group[0]
    if options.gas is not None or any(options.gravity) or options.wall_law != "table":
        for job, _, own, colon in group:
            run = run_device(device, colon, own, seconds=seconds, patience=patience or None)
            yield result_of(job, device, run.outcome, run.records, colon, run.radius, start=own.start_depth)
        return
    radius = build_device_scene(device, options, pose=Pose()).handles.samples[-1].radius
    colons, starts = [one.colon for one in group], [one.options.start_depth for one in group]
    found = run_devices(device, colons, options, seconds=seconds, starts=starts, patience=patience or math.inf)
    for one, start, (outcome, records) in zip(group, starts, found, strict=True):
        yield result_of(one.job, device, outcome, records, one.colon, radius, start=start)


def _start_warp(study: Study, folder: Path) -> Runner:
    """Jobs of one design share a batch: colons and friction are numbers of each world, a design is a model."""
    from haustra.envs.sim.warp_setup import use_warp

    use_warp()
    names, starts = tuple(map(str, study.conditions["colon"])), study.conditions.get("start", (None,))
    cases = [(name, start) for name in names for start in starts]
    seconds = float(study.options["seconds"])

    def run(jobs: Sequence[Job]) -> Iterable[Result]:
        groups: dict[Any, list[Job]] = {}
        for job in jobs:
            groups.setdefault(tuple(sorted(job.variables.items())), []).append(job)
        for group in groups.values():
            try:
                yield from halved(lambda some: _answer_warp(study, cases, some, seconds), group, full=_out_of_memory)
            except HaustraError as error:
                yield from (failure(job, error) for job in group)

    return run


def _out_of_memory(error: Exception) -> bool:
    return "RESOURCE_EXHAUSTED" in str(error)


def _answer_warp(
    study: Study, cases: Sequence[tuple[str, Value | None]], jobs: Sequence[Job], seconds: float
) -> list[Result]:
    """Rows of jobs of one design; `cases` are the study's colons, each with each of its starts."""
    import jax.numpy as jnp

    from haustra.envs.sim.device_warp import Conditions, WarpDevice, drive_worlds

    setups = [build_setup(study, job.variables, job.conditions) for job in jobs]
    device, options = setups[0]
    colons = [_colon(name) for name, _ in cases]
    begun = [
        _begun(device, colon, options, {} if start is None else {"start": start})
        for colon, (_, start) in zip(colons, cases, strict=True)
    ]
    scene = build_device_scene(device, options)
    poses = [pose_in(colon, device, one) for colon, one in zip(colons, begun, strict=True)]
    backend = WarpDevice.of(scene, device_tables(scene, colons, poses), starts=[pose.arc for pose in poses])
    number = [cases.index((str(job.conditions["colon"]), job.conditions.get("start"))) for job in jobs]
    conditions = Conditions(
        jnp.asarray(number),
        jnp.asarray([one.friction for _, one in setups], jnp.float32),
        jnp.asarray([one.wall_stiffness for _, one in setups], jnp.float32),
    )
    backend.check(conditions)
    records = drive_worlds(backend, conditions, seconds=seconds, interval=CONTROL_INTERVAL)
    found = []
    for row, job in enumerate(jobs):
        colon = colons[number[row]]
        recorded = {name: values[row] for name, values in records.items()}
        outcome, kept = _until_ended(recorded, colon.centreline.length)
        start, nose = begun[number[row]].start_depth, scene.handles.samples[-1].radius
        found.append(result_of(job, device, outcome, kept, colon, nose, start=start))
    return found


def _until_ended(records: dict[str, np.ndarray], length: float) -> tuple[Outcome, dict[str, np.ndarray]]:
    """How one world of a batch ended, and its records until then: the batch goes on to the end."""
    for index in range(len(records["time"])):
        if not records["healthy"][index]:
            return Outcome.DIVERGED, records
        if outcome := ended({name: values[index] for name, values in records.items()}, length):
            return outcome, {name: values[: index + 1] for name, values in records.items()}
    return time_is_up(records), records


QUESTION = Question(
    scores=SCORES,
    conditions={
        "colon": Column("colon", "text", "grown-<seed>, also as grown-<seed>-hard-2kPa, or the folder of a colon"),
        "friction": Column("friction", "1", "Coulomb's coefficient between device and wall"),
        "start": Column("start", "m", "next to where the tip stands at first; where the scene says when not given"),
    },
    may_lack=("start",),
    options=DeviceStudyOptions,
    check=build_setup,
)
NATIVE = Backend(start=_start, batch=TOGETHER, alike="design", together=True)
WARP = Backend(start=_start_warp, batch=BATCH, most_workers=1, together=True)
"""One process: it fills the device by itself."""
