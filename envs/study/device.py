"""How far any device gets in a colon by its own driver, as a question for studies."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
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

SCORES = (
    Column("outcome", "text", "why the run ended: completed, stuck, time_up or escaped"),
    Column("reach", "1", "how far the tip came, as a share of the colon's length"),
    Column("tip_arc_max_m", "m", "the same as a length along the colon"),
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
    seed = str(conditions["colon"]).removeprefix("grown-")
    if seed != conditions["colon"] and not (seed.isascii() and seed.isdecimal() and len(seed) < 19):
        raise InvalidStudyError(f"Colon '{conditions['colon']}' is not known: give grown-<seed> or a colon's folder.")
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
    job: Job, device: Device, outcome: Outcome, records: Mapping[str, np.ndarray], colon: Colon, radius: float
) -> Result:
    """A job's row from what was recorded of a device with a nose of that radius [m]."""
    if outcome is Outcome.DIVERGED:
        return Result(job.id, "diverged", reason=outcome.advice)
    found = common_scores(outcome, records, device.readings, colon, radius)
    own = [name for reading in device.readings for name in reading_columns(reading)]
    scores: dict[str, Any] = {
        **found,
        "escaped": float(outcome is Outcome.ESCAPED),
        "readings": " ".join(f"{name}={found[name]:.6g}" for name in own),
    }
    return Result(job.id, "finished", scores={column.name: scores[column.name] for column in SCORES})


@lru_cache(maxsize=8)
def _colon(name: str) -> Colon:
    seed = name.removeprefix("grown-")
    return load_colon(Path(name)) if seed == name else grow_colon(seed=int(seed))


def _start(study: Study, folder: Path) -> Runner:
    """Jobs of one design and friction share a batch, in which one step of many colons costs half of as many alone."""

    def run(jobs: Sequence[Job]) -> Iterable[Result]:
        groups: dict[Any, list[_Placed]] = {}
        for job in jobs:
            try:
                device, options = build_setup(study, job.variables, job.conditions)
                colon = _colon(str(job.conditions["colon"]))
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
        for job, _, _, colon in group:
            run = run_device(device, colon, options, seconds=seconds, patience=patience or None)
            yield result_of(job, device, run.outcome, run.records, colon, run.radius)
        return
    radius = build_device_scene(device, options, pose=Pose()).handles.samples[-1].radius
    colons = [one.colon for one in group]
    found = run_devices(device, colons, options, seconds=seconds, patience=patience or math.inf)
    for one, (outcome, records) in zip(group, found, strict=True):
        yield result_of(one.job, device, outcome, records, one.colon, radius)


def _start_warp(study: Study, folder: Path) -> Runner:
    """Jobs of one design share a batch: colons and friction are numbers of each world, a design is a model."""
    from haustra.envs.sim.warp_setup import use_warp

    use_warp()
    names = tuple(map(str, study.conditions["colon"]))
    seconds = float(study.options["seconds"])

    def run(jobs: Sequence[Job]) -> Iterable[Result]:
        groups: dict[Any, list[Job]] = {}
        for job in jobs:
            groups.setdefault(tuple(sorted(job.variables.items())), []).append(job)
        for group in groups.values():
            try:
                yield from halved(lambda some: _answer_warp(study, names, some, seconds), group, full=_out_of_memory)
            except HaustraError as error:
                yield from (failure(job, error) for job in group)

    return run


def _out_of_memory(error: Exception) -> bool:
    return "RESOURCE_EXHAUSTED" in str(error)


def _answer_warp(study: Study, names: tuple[str, ...], jobs: Sequence[Job], seconds: float) -> list[Result]:
    import jax.numpy as jnp

    from haustra.envs.sim.device_warp import Conditions, WarpDevice, drive_worlds

    setups = [build_setup(study, job.variables, job.conditions) for job in jobs]
    device, options = setups[0]
    colons = [_colon(name) for name in names]
    scene, poses = build_device_scene(device, options), [pose_in(one, device, options) for one in colons]
    backend = WarpDevice.of(scene, device_tables(scene, colons, poses), starts=[pose.arc for pose in poses])
    number = [names.index(str(job.conditions["colon"])) for job in jobs]
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
        found.append(result_of(job, device, outcome, kept, colon, scene.handles.samples[-1].radius))
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
        "colon": Column("colon", "text", "grown-<seed>, or the folder of a colon"),
        "friction": Column("friction", "1", "Coulomb's coefficient between device and wall"),
    },
    options=DeviceStudyOptions,
    check=build_setup,
)
NATIVE = Backend(start=_start, batch=TOGETHER, one_design=True)
WARP = Backend(start=_start_warp, batch=BATCH, most_workers=1)
"""One process: it fills the device by itself."""
