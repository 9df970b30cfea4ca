"""One device in one patient: as far as it comes, and the scores that all devices share.

A scope is driven by the lumen follower, by a hand that straightens it, in linear time; any other device by its own
driver, natively. Both end in the same scores. Colons hang on their mesentery wherever a device honours that. A run ends
in the caecum, when the device is out or lost, when it came no further for `patience`, or when its time is up.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from haustra.envs.runs.device_run import DeviceRun, burden_scores, common_scores, run_device
from haustra.envs.runs.measure.recorded import RecordedRun
from haustra.envs.runs.outcome import Outcome
from haustra.envs.study.compare_patients import Patient
from haustra.envs.study.compare_pictures import ScopeRun
from haustra.envs.study.compare_sight import Looks, looked_at, mucosa_seen
from haustra.envs.study.compare_widths import passed_bands
from haustra.envs.study.study import Value
from haustra.errors import UnsupportedSceneError
from haustra.fields import number
from haustra.models.device_scene import build_device_scene, device_options
from haustra.models.devices.base import Device
from haustra.models.devices.scope.interface import Scope
from haustra.models.presets import TABLE, find_preset
from haustra.models.scene import SceneOptions

CURVE_STEP = 1.0
"""Time between points of curves that are kept [s]; engineering choice."""
SITES = ("rectum", "sigmoid", "descending", "transverse", "ascending", "caecum", "splenic_flexure", "hepatic_flexure")
"""Where pain is told."""


@dataclass(frozen=True)
class CompareOptions:
    """How devices are compared."""

    seconds: float = number("s", 0.02, 36_000.0, default=240.0)
    """Longest run, in simulated time [s]."""
    patience: float = number("s", 1.0, 3600.0, default=40.0)
    """A device that comes no further for so long is stuck [s]."""


@dataclass(frozen=True)
class Passage:
    """How a device fared in a patient."""

    scores: dict[str, Any]
    curves: dict[str, list[float]]
    """Over time, and what `haustra.envs.study.compare_widths.passed_bands` tells."""
    run: DeviceRun | ScopeRun
    """For whoever draws it."""


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
    records = run.records
    common = common_scores(run.outcome, records, device.readings, colon, run.radius)
    kept = looked_at(records["time"])
    looks = Looks(*(records[name][kept] for name in ("tip", "tip_frame", "tip_arc", "displacement")))
    common |= {"mucosa_seen": mucosa_seen(colon, looks, view_deg=device.view_deg, device_radius=run.radius)}
    borne = burden_scores(records, colon)
    return Passage(
        _scores(common, borne, begins=float(records["tip_arc"][0]), mesentery=run.mesentery),
        _curves(records, patient),
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
        return Passage({"outcome": Outcome.DIVERGED.value}, {}, ScopeRun(scene, run, seen))
    # Stuck for as long as others are given: it ends then, as theirs do.
    kept = _until_stuck(seen.tip_arc, seen.time, options.patience)
    seen = replace(seen, **{name: values[:kept] for name, values in vars(seen).items()})
    records = dict(vars(seen))
    if kept < len(seen.time):
        outcome = Outcome.STUCK
    pushed = np.diff(records["insertion"], prepend=records["insertion"][:1]) / records["time"][0]
    records |= {
        "deepest": records["outside"],
        "wall_pressure": records["shear"].max(axis=1) / max(patient.friction, 1e-9),
        "power": np.maximum(records["push_force"] * pushed, 0.0),
    }
    common = common_scores(outcome, records, (), colon, scene.cable.radius)
    own = {"view_deg": device.view_deg, "device_radius": scene.cable.radius}
    common |= {"p_perforation": _torn(records["load"], outcome)}
    common |= {"mucosa_seen": mucosa_seen(colon, _looks(RecordedRun(scene, seen)), **own)}
    return Passage(
        _scores(common, burden_scores(records, colon), begins=float(records["tip_arc"][0]), mesentery=True),
        _curves(records, patient),
        ScopeRun(scene, run, seen),
    )


def _looks(run: RecordedRun) -> Looks:
    seen, frames = run.trajectory, []
    kept = looked_at(seen.time)
    for record in kept:
        run.place(int(record))
        frames.append(run.tip_frame())
    return Looks(seen.tip[kept], np.array(frames), seen.tip_arc[kept], seen.displacement[kept])


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
        "mucosa_seen": common["mucosa_seen"],
        "work_J": borne["work_J"],
        "begins_m": begins,
        "mesentery": float(mesentery),
        **{f"pain_{site}": float(sites.get(site, 0.0)) for site in SITES},
    }


def _curves(records: Mapping[str, Any], patient: Patient) -> dict[str, list[float]]:
    time = np.asarray(records["time"])
    every = max(1, round(CURVE_STEP / float(time[0])))
    names = {"time_s": 1, "tip_arc_m": 1, "wall_force_N": 1, "colon_moved_mm": 1e3}
    parts = (records[name] for name in ("time", "tip_arc", "wall_force", "colon_moved"))
    over_time = {
        name: (scale * np.asarray(part))[::every].round(5).tolist()
        for (name, scale), part in zip(names.items(), parts, strict=True)
    }
    return over_time | passed_bands(patient.colon, time, np.asarray(records["tip_arc"]))
