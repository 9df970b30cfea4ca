"""Devices side by side: the same patients for all, each device by the driver that comes with it.

A scope is driven by the lumen follower, by a hand that straightens it, in linear time; any other device by its own
driver, natively. Both end in the same scores. Colons hang on their mesentery wherever a device honours that. A run ends
in the caecum, when the device is out or lost, when it came no further for `patience`, or when its time is up.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.runs.device_run import DeviceRun, burden_scores, common_scores, run_device
from haustra.envs.runs.insertion import Insertion
from haustra.envs.runs.outcome import Outcome
from haustra.envs.study.compare_patients import Patient, patient_named, patients
from haustra.envs.study.compare_table import summarise
from haustra.envs.study.questions import Backend, Question, Runner, one_by_one
from haustra.envs.study.store import read_store
from haustra.envs.study.study import Column, Job, Result, Sampler, Study, Value
from haustra.errors import InvalidOptionError, UnsupportedSceneError
from haustra.fields import number
from haustra.models.device_scene import build_device_scene, device_options
from haustra.models.devices.base import Device, load_device
from haustra.models.devices.scope.interface import Scope
from haustra.models.presets import TABLE, find_preset
from haustra.models.scene import SceneOptions

PICTURES = "pictures"
"""Folder of pictures within a comparison's: one a device, of the first patient."""
CURVE_STEP = 1.0
"""Time between points of curves that are kept [s]."""
SCORES = (
    Column("intubation", "1", "1 where the caecum was reached"),
    Column("reach", "1", "how far the tip came, as a share of the colon's length"),
    Column("gained_m", "m", "how much further along the colon it came than it began"),
    Column("time_s", "s", "simulated time until the run ended"),
    Column("outcome", "text", "what stopped it"),
    Column("wall_force_peak_N", "N", "largest resultant wall force on one body"),
    Column("wall_force_mean_N", "N", "mean of that over the run"),
    Column("wall_pressure_peak_kPa", "kPa", "largest pressure of a body on the patch of wall that it lies on"),
    Column("wall_impulse_N_s_m", "N s/m", "sum of all wall forces over time, per metre gained"),
    Column("colon_moved_mm", "mm", "farthest that a place of the colon was moved from where it was at rest"),
    Column("mesentery_extension_mm", "mm", "farthest that the mesentery was drawn out beyond its slack"),
    Column("mesentery_extension_mean_mm", "mm", "mean over the run of the farthest at each time"),
    Column("extension_per_metre_mm_m", "mm/m", "largest extension of the mesentery per metre gained"),
    Column("p_perforation", "1", "share of people whose colon would be perforated"),
    Column("pain", "1", "largest tension of wall or mesentery over that which is assumed to hurt"),
    Column("pain_site", "text", "where that was"),
    Column("work_J", "J", "work that hand or actuators put in along the body"),
    Column("begins_m", "m", "where along the colon its tip began"),
    Column("mesentery", "1", "1 where the colon was on its mesentery, 0 where it stood fixed"),
)
_SCOPE_RADIUS = 0.0064
"""As pictures show scopes [m]."""
_SITES = ("rectum", "sigmoid", "descending", "transverse", "ascending", "caecum", "splenic_flexure", "hepatic_flexure")
PAIN_BY_SITE = tuple(Column(f"pain_{site}", "1", f"largest pain at the {site.replace('_', ' ')}") for site in _SITES)


@dataclass(frozen=True)
class CompareOptions:
    """How devices are compared."""

    seconds: float = number("s", 0.02, 36_000.0, default=240.0)
    """Longest run, in simulated time [s]."""
    patience: float = number("s", 1.0, 3600.0, default=40.0)
    """A device that comes no further for so long is stuck [s]."""


def comparison(devices: Sequence[str], cohort: str, options: CompareOptions | None = None) -> Study:
    """What is compared, as a study.

    Raises:
        InvalidOptionError: when there are fewer than two devices, one is there twice, or the cohort is not known.
        InvalidDesignError: when a device is not known.
    """
    options = options or CompareOptions()
    if len(devices) < 2 or len(set(devices)) < len(devices):
        raise InvalidOptionError(f"Give two or more devices, each once: found {', '.join(devices) or 'none'}.")
    asked = [str(Path(name).resolve()) if name.endswith(".toml") else name for name in devices]
    names = [load_device(name).name for name in asked]
    if twice := {name for name in names if names.count(name) > 1}:
        raise InvalidOptionError(f"Two devices are called '{twice.pop()}': give them names of their own.")
    return Study(
        question="compare",
        title=f"{', '.join(names)} in cohort {cohort}",
        base="default",
        variables=(),
        conditions={"device": tuple(asked), "patient": tuple(one.name for one in patients(cohort))},
        objectives=(),
        sampler=Sampler(kind="list", designs=({"name": "as designed"},)),
        options={"seconds": options.seconds, "patience": options.patience},
    )


@dataclass(frozen=True)
class Passage:
    """How a device fared in a patient."""

    scores: dict[str, Any]
    curves: dict[str, list[float]]
    picture: Any
    """The run, for whoever draws it: a `DeviceRun` or an `Insertion`."""


def pass_through(device: Device, patient: Patient, options: CompareOptions) -> Passage:
    """Let a device go as far as it comes in a patient."""
    return _scope(device, patient, options) if isinstance(device, Scope) else _device(device, patient, options)


def _device(device: Device, patient: Patient, options: CompareOptions) -> Passage:
    colon = patient.colon
    own = {"friction": patient.friction, "wall_stiffness": patient.wall_stiffness}
    scene = _options(device, own)
    run = run_device(device, colon, scene, seconds=options.seconds, patience=options.patience)
    if run.outcome is Outcome.DIVERGED:
        return Passage({"outcome": run.outcome.value}, {}, run)
    common = common_scores(run.outcome, run.records, device.readings, colon, run.radius)
    borne, arcs = burden_scores(run.records, colon), run.records["tip_arc"]
    return Passage(
        _scores(common, borne, begins=float(arcs[0]), mesentery=run.mesentery),
        _curves(run.records["time"], arcs, run.records["wall_force"], run.records["colon_moved"]),
        run,
    )


def _options(device: Device, own: Mapping[str, float]) -> SceneOptions:
    """On the mesentery where the device honours that."""
    moved = device_options(device, mesentery=True, **own)
    try:
        build_device_scene(device, moved)
    except UnsupportedSceneError:
        return device_options(device, mesentery=False, **own)
    return moved


def _scope(device: Scope, patient: Patient, options: CompareOptions) -> Passage:
    from haustra.envs.control.follower import FollowerSettings
    from haustra.envs.runs.linear_insertion import run_linear_insertion
    from haustra.models.scene import build_scene

    colon = patient.colon
    scene = build_scene(colon, None, device.design, scope_options(patient), show_lumen=False)
    run = run_linear_insertion(scene, seconds=options.seconds, settings=FollowerSettings(straighten=True))
    seen, outcome = run.trajectory, run.outcome
    if outcome is Outcome.DIVERGED or not len(seen.time):
        return Passage({"outcome": Outcome.DIVERGED.value}, {}, run)
    # Stuck for as long as others are given: it ends then, as theirs do.
    kept = _until_stuck(seen.tip_arc, seen.time, options.patience)
    records = {name: getattr(seen, name)[:kept] for name in seen.__dataclass_fields__ if len(getattr(seen, name))}
    if kept < len(seen.time):
        outcome = Outcome.STUCK
    pushed = np.diff(records["insertion"], prepend=records["insertion"][:1]) / records["time"][0]
    records |= {
        "deepest": records["outside"],
        "wall_pressure": records["shear"].max(axis=1) / max(patient.friction, 1e-9),
        "power": np.maximum(records["push_force"] * pushed, 0.0),
    }
    common = common_scores(outcome, records, (), colon, scene.cable.radius)
    common |= {"p_perforation": _torn(records["load"], outcome)}
    return Passage(
        _scores(common, burden_scores(records, colon), begins=float(records["tip_arc"][0]), mesentery=True),
        _curves(records["time"], records["tip_arc"], records["wall_force"], records["colon_moved"]),
        run,
    )


def scope_options(patient: Patient) -> SceneOptions:
    """How scopes are modelled in a patient: as `haustra run` does, on the mesentery.

    Coarser joints kink behind folds and let go in jolts, which press up to twice as hard.
    """
    own = {"friction": patient.friction, "wall_stiffness": patient.wall_stiffness}
    return replace(find_preset("balanced").apply(law=TABLE), mesentery=True, **own)


def _torn(load: np.ndarray, outcome: Outcome) -> float:
    """Share of people whose colon would be perforated, by what was recorded of each link."""
    from haustra.models.injury.perforation import TORN, perforation_probability

    return float(perforation_probability(TORN if outcome is Outcome.ESCAPED else load.max()))


def _until_stuck(arcs: np.ndarray, time: np.ndarray, patience: float) -> int:
    """Records until a run had come no further for so long [s]."""
    best = np.maximum.accumulate(arcs)
    fresh = np.concatenate([[True], best[1:] > best[:-1]])
    since = time - np.maximum.accumulate(np.where(fresh, time, 0.0))
    late = np.flatnonzero(since > patience)
    return int(late[0]) if len(late) else len(time)


def _scores(
    common: Mapping[str, Any], borne: Mapping[str, Any], *, begins: float, mesentery: bool
) -> dict[str, Value | None]:
    gained = common["tip_arc_max_m"] - begins
    sites, extension = borne["pain_by_site"], borne["mesentery_extension_peak_mm"]
    worst = max(sites, key=lambda site: sites[site])
    return {
        "intubation": float(common["outcome"] == Outcome.COMPLETED.value),
        "reach": common["reach"],
        "gained_m": gained,
        "time_s": common["simulated_s"],
        "outcome": common["outcome"],
        "wall_force_peak_N": common["wall_force_peak_N"],
        "wall_force_mean_N": common["wall_force_mean_N"],
        "wall_pressure_peak_kPa": borne["wall_pressure_peak_kPa"],
        "wall_impulse_N_s_m": borne["wall_impulse_N_s_m"],
        "colon_moved_mm": borne["colon_moved_peak_mm"] if mesentery else None,
        "mesentery_extension_mm": extension if mesentery else None,
        "mesentery_extension_mean_mm": borne["mesentery_extension_mean_mm"] if mesentery else None,
        "extension_per_metre_mm_m": extension / gained if mesentery and gained > 0 else None,
        "p_perforation": common["p_perforation"],
        "pain": borne["pain_peak"],
        "pain_site": worst if sites[worst] > 0 else "none",
        "work_J": borne["work_J"],
        "begins_m": begins,
        "mesentery": float(mesentery),
        **{f"pain_{site}": float(sites.get(site, 0.0)) for site in _SITES},
    }


def _curves(time: np.ndarray, arcs: np.ndarray, force: np.ndarray, moved: np.ndarray) -> dict[str, list[float]]:
    every = max(1, round(CURVE_STEP / float(time[0])))
    names = ("time_s", "tip_arc_m", "wall_force_N", "colon_moved_mm")
    parts = (time, arcs, force, 1e3 * np.asarray(moved))
    return {name: np.asarray(part)[::every].round(5).tolist() for name, part in zip(names, parts, strict=True)}


def _start(study: Study, folder: Path) -> Runner:
    options = CompareOptions(**{name: float(value) for name, value in study.options.items()})
    first = str(study.conditions["patient"][0])

    def answer(job: Job) -> Result:
        device, patient = load_device(str(job.conditions["device"])), patient_named(str(job.conditions["patient"]))
        found = pass_through(device, patient, options)
        if found.scores["outcome"] == Outcome.DIVERGED.value:
            return Result(job.id, "diverged", reason=Outcome.DIVERGED.advice)
        if patient.name == first:
            draw(found.picture, patient, folder / PICTURES / f"{device.name}.png")
        return Result(job.id, "finished", scores=found.scores, curves=found.curves)

    return one_by_one(answer)


def draw(run: "DeviceRun | Insertion", patient: Patient, path: Path) -> None:
    """Draw how a run ended into a PNG file, and the device close by beside it."""
    from haustra.envs.view.device_folder import end_pictures
    from haustra.envs.view.picture.image import write_png
    from haustra.envs.view.picture.outside import default_rotation, outside_view

    path.parent.mkdir(exist_ok=True)
    if isinstance(run, DeviceRun):
        pictures = end_pictures(run)
        write_png(path, pictures["outside"])
        write_png(path.with_name(f"{path.stem}-close.png"), pictures["device"])
        return
    rotation = default_rotation(patient.colon.lumen, patient.colon.centreline.points)
    write_png(path, outside_view(run.colon.lumen, run.shape, _SCOPE_RADIUS, rotation=rotation))


def compared(folder: Path) -> dict[str, Any]:
    """What the runs of a comparison's folder say so far.

    Returns:
        `devices` and `pairs` (`haustra.envs.study.compare_table.summarise`), `runs`, a row a finished run with its
        curves, and `lost`, those that did not finish and why.

    Raises:
        UnreadableFileError: when the folder holds no comparison.
    """
    runs, lost = [], []
    with read_store(folder) as store:
        study = store.study
        for row in store.rows():
            device, patient = (str(row["conditions"][name]) for name in ("device", "patient"))
            own = {"device": load_device(device).name, "patient": patient}
            if row["state"] == "finished":
                runs.append({**own, **row["scores"], "curves": row["curves"]})
            elif row["state"] in ("failed", "diverged"):
                lost.append({**own, "state": row["state"], "reason": row["reason"]})
    names = [load_device(str(name)).name for name in study.conditions["device"]]
    return {**summarise(runs, names), "runs": runs, "lost": lost, "title": study.title}


def _check(study: Study, variables: Mapping[str, float], conditions: Mapping[str, Value]) -> None:
    load_device(str(conditions["device"]))
    patient_named(str(conditions["patient"]))


QUESTION = Question(
    scores=(*SCORES, *PAIN_BY_SITE),
    conditions={
        "device": Column("device", "text", "name of a shipped device, or a TOML file"),
        "patient": Column("patient", "text", "cohort and number, as in quick-0"),
    },
    options=CompareOptions,
    check=_check,
)
NATIVE = Backend(start=_start)
