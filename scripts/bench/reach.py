"""What the whole tracked robot pulls, how far it comes in grown colons by its own driver, and what stops it there."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from haustra.envs.runs.device_batch import run_devices
from haustra.envs.runs.device_run import Records, common_scores
from haustra.envs.runs.measure.progress import segment_at
from haustra.envs.runs.outcome import Outcome
from haustra.envs.sim.device_native import NativeDevice
from haustra.errors import InvalidDesignError
from haustra.files import write_json
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import colon_hash, load_colon
from haustra.models.device_scene import device_options, device_tables
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign
from haustra.models.devices.tracked.drive import drive_point
from haustra.models.devices.tracked.held import held_scene, tension
from haustra.models.devices.tracked.implied import SPEEDS_RPM
from haustra.models.devices.tracked.interface import TrackedRobot
from haustra.models.devices.tracked.law import load_table
from haustra.models.devices.tracked.published import SURFACES
from haustra.models.devices.tracked.standing import places_that_fit
from haustra.reading import read_document

FIRST_SEED = 300_000
"""First seed of the grown colons, which nothing was trained on."""
AT_ONCE = 4
"""Most colons that one process runs together, where there are fewer processes than colons."""
HELD_TIMESTEP, HELD_SECONDS, HELD_SETTLED = 2e-3, 1.6, 0.6
"""Time step, length, and time until steady of a run that is held by a string [s]."""
LATE = 5.0
"""Readings over this last time of a run tell what stopped it [s]."""
EARLIEST = 0.10
"""The robot stands where it fits first beyond this arc length [m]: behind the anal canal and the rectum's folds."""
WIDE, HELD, FORCED = 0.97, 0.5, 0.25
"""A robot stands in a lumen that is too wide where its tracks stand out to this share of their reach; its worm is held
where that runs at less than this share of its speed; the core blocks it where it bears more than this share of the
treads' load. Engineering choices."""


def reach_in(
    device: TrackedRobot, seeds: Sequence[int], *, seconds: float, mesentery: bool = True
) -> list[dict[str, Any]]:
    """Runs in grown colons: where each began, how far it came, what it pressed with, and what stopped it."""
    colons = [grow_colon(seed=seed) for seed in seeds]
    begin = [first_place(device, colon) for colon in colons]
    rows = _driven(device, colons, begin, seconds=seconds, mesentery=mesentery)
    return [{"seed": seed, **row} for seed, row in zip(seeds, rows, strict=True)]


def reach_within(
    device: TrackedRobot, colon: Colon, starts: Sequence[float], *, seconds: float, mesentery: bool = True
) -> list[dict[str, Any]]:
    """Runs in one colon, each from where the robot fits next to one of some arc lengths of its nose [m]."""
    try:
        begin = [device.nearest_start(colon, start) for start in starts]
    except InvalidDesignError:
        begin = [None for _ in starts]
    rows = _driven(device, [colon] * len(starts), begin, seconds=seconds, mesentery=mesentery)
    return [{"asked_m": start, **row} for start, row in zip(starts, rows, strict=True)]


def _driven(
    device: TrackedRobot, colons: Sequence[Colon], begin: Sequence[float | None], *, seconds: float, mesentery: bool
) -> list[dict[str, Any]]:
    """A row for each colon, from where the robot begins there [m]; None where it fits nowhere."""
    nowhere: dict[str, Any] = {"start_m": None, "came_m": 0.0, "reach": 0.0, "stopped_by": "it fits nowhere"}
    rows = [dict(nowhere) for _ in colons]
    fits = [(place, start) for place, start in enumerate(begin) if start is not None]
    if not fits:
        return rows
    inside, starts = [colons[place] for place, _ in fits], [start for _, start in fits]
    options = device_options(device, mesentery=mesentery)
    runs = run_devices(device, inside, options, seconds=seconds, starts=starts)
    for (place, start), (outcome, records) in zip(fits, runs, strict=True):
        rows[place] = {"start_m": start, **_row(device, colons[place], start, outcome, records)}
    return rows


def _row(device: TrackedRobot, colon: Colon, start: float, outcome: Outcome, records: Records) -> dict[str, Any]:
    scores = common_scores(outcome, records, device.readings, colon, device.design.core_diameter / 2)
    return {
        "came_m": scores["tip_arc_max_m"] - start,
        "reach": scores["reach"],
        "simulated_s": scores["simulated_s"],
        "track_force_peak_N": scores["normal_peak_N"] / TRACKS,
        "track_force_mean_N": scores["normal_mean_N"] / TRACKS,
        "wall_force_peak_N": scores["wall_force_peak_N"],
        "wall_pressure_peak_kPa": float(np.max(records["wall_pressure"], initial=0.0)) / 1e3,
        "wall_pressure_mean_kPa": float(np.mean(records["wall_pressure"])) / 1e3,
        "p_perforation": scores["p_perforation"],
        "slip_work_J": slip_work(device, records),
        "stopped_by": stopped_by(device, outcome, records),
        "stopped_in": segment_at(colon, float(records["tip_arc"][-1])),
        "lumen_there_m": float(2 * np.interp(records["tip_arc"][-1], colon.centreline.arc, np.median(colon.radius, 1))),
        **{f"{name}_there": value for name, value in late_means(records).items()},
    }


def first_place(device: TrackedRobot, colon: Colon) -> float | None:
    """Arc length of the nose where the robot fits first [m]; None when it fits nowhere."""
    line, design = colon.centreline, device.design
    nose, half = (design.core_length + design.core_diameter) / 2, design.core_length / 2
    inside = line.arc[(line.arc >= max(EARLIEST, half)) & (line.arc <= line.length - half - nose)]
    fits = places_that_fit(colon, design, inside)
    return float(fits[0]) + nose if len(fits) else None


def stopped_by(device: TrackedRobot, outcome: Outcome, records: Records) -> str:
    """What the readings of the last seconds say ended a run's way."""
    if outcome is Outcome.COMPLETED:
        return "the caecum"
    if outcome in (Outcome.DIVERGED, Outcome.ESCAPED):
        return outcome.value
    mean = late_means(records)
    if mean["worm_share"] < HELD:
        return "the worm's torque limit"
    if outcome is Outcome.TIME_UP:
        return "time"
    if mean["core_force"] > FORCED * mean["normal"]:
        return "the core against the wall"
    return "a lumen too wide" if mean["width"] > WIDE * device.design.largest_diameter else "treads that slip"


def late_means(records: Records) -> dict[str, float]:
    """Means over the last seconds: width [m], forces of treads and core on the wall [N], share of the worm's speed."""
    late = records["time"] > records["time"][-1] - LATE
    return {name: float(records[name][late].mean()) for name in ("width", "normal", "core_force", "worm_share")}


def slip_work(device: TrackedRobot, records: Records) -> float:
    """Work of the treads' friction on the wall by sliding [J]: of treads that run further than the robot goes."""
    if len(records["time"]) < 2:
        return 0.0
    step = np.diff(records["time"])
    slid = device.design.tread_speed(device.rpm) * records["worm_share"][1:] - np.diff(records["tip_arc"]) / step
    return float((np.abs(records["traction"][1:]) * np.maximum(slid, 0.0) * step).sum())


def bench_reach(
    device: TrackedRobot,
    folder: Path,
    *,
    colons: int,
    seconds: float,
    workers: int = 1,
    progress: Any = lambda done, note: None,
) -> list[dict[str, Any]]:
    """Runs in that many colons by so many processes, one file each, so that what is done is not done again."""
    asked = json.loads(json.dumps({"device": device.describe(), "seconds": seconds}))
    paths = {FIRST_SEED + number: folder / f"{device.name}-{FIRST_SEED + number}.json" for number in range(colons)}
    rows = {}
    for seed, path in paths.items():
        known = read_document(path, "result") if path.is_file() else {}
        if known.get("asked") == asked:
            rows[seed] = known["row"]
    missing = [seed for seed in paths if seed not in rows]
    progress(len(rows), device.name)
    for found in _answers(device, missing, seconds, workers):
        for row in found:
            rows[row["seed"]] = row
            write_json(paths[row["seed"]], {"asked": asked, "row": row})
        progress(len(rows), device.name)
    return [rows[seed] for seed in paths]


def bench_within(
    device: TrackedRobot, folder: Path, colons: Sequence[Path], *, starts: Sequence[float], seconds: float
) -> dict[str, list[dict[str, Any]]]:
    """Runs from several starts [m] in colons of some folders, by colon; one file a colon."""
    found = {}
    for place in colons:
        colon = load_colon(place)
        about = {"device": device.describe(), "seconds": seconds, "starts": starts, "colon": colon_hash(colon)}
        asked, path = json.loads(json.dumps(about)), folder / f"{device.name}-{colon.name}.json"
        known = read_document(path, "result") if path.is_file() else {}
        if known.get("asked") != asked:
            known = {"asked": asked, "rows": reach_within(device, colon, starts, seconds=seconds)}
            write_json(path, known)
        found[colon.name] = known["rows"]
    return found


def _answers(
    device: TrackedRobot, seeds: Sequence[int], seconds: float, workers: int
) -> Iterator[list[dict[str, Any]]]:
    """Rows of some colons at a time, as they are done."""
    size = min(AT_ONCE, math.ceil(len(seeds) / workers))
    some = [seeds[first : first + size] for first in range(0, len(seeds), size or 1)]
    if workers == 1 or len(some) < 2:
        yield from (reach_in(device, own, seconds=seconds) for own in some)
        return
    with ProcessPoolExecutor(min(workers, len(some)), mp_context=get_context("spawn")) as pool:
        jobs = [pool.submit(reach_in, device, own, seconds=seconds) for own in some]
        yield from (job.result() for job in as_completed(jobs))


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Mean way and reach, what was pressed, and how often each thing stopped the robot."""
    ran = [row for row in rows if "wall_force_peak_N" in row]
    reasons: Mapping[str, int] = {
        reason: sum(row["stopped_by"] == reason for row in rows) for reason in {row["stopped_by"] for row in rows}
    }

    def mean(name: str) -> float:
        return float(np.mean([row[name] for row in ran])) if ran else 0.0

    return {
        "colons": len(rows),
        "came_mean_m": float(np.mean([row["came_m"] for row in rows])),
        "came_median_m": float(np.median([row["came_m"] for row in rows])),
        "reach_mean": float(np.mean([row["reach"] for row in rows])),
        "track_force_mean_N": mean("track_force_mean_N"),
        "wall_force_peak_N": mean("wall_force_peak_N"),
        "wall_pressure_peak_kPa": mean("wall_pressure_peak_kPa"),
        "wall_pressure_mean_kPa": mean("wall_pressure_mean_kPa"),
        "slip_work_mean_J": mean("slip_work_J"),
        "stopped_by": dict(sorted(reasons.items(), key=lambda item: -item[1])),
    }


def sizes(device: TrackedRobot) -> dict[str, Any]:
    """What sets robots apart, each at its own scale."""
    design = device.design
    names = ("nominal_diameter", "smallest_diameter", "largest_diameter", "core_length", "core_diameter")
    return {
        **{f"{name}_mm": 1e3 * getattr(design, name) for name in names},
        "bellows_stiffness_N_m": design.bellows.stiffness,
        "bellows_preload_N": design.bellows.preload,
        "torque_limit_mNm": 1e3 * design.worm.torque_limit,
        "regulation": device.regulation,
    }


def held_rows(device: TrackedRobot) -> list[dict[str, Any]]:
    """The robot held by a string in a straight tube of its nominal diameter, at the paper's speeds on both surfaces."""
    return [
        {"surface": surface, **held_run(device, friction, rpm)}
        for surface, friction in SURFACES.items()
        for rpm in SPEEDS_RPM
    ]


def held_run(device: TrackedRobot, friction: float, rpm: float) -> dict[str, Any]:
    """Force, ripple, stress and slip of one speed, once steady, and how far the force is off the closed form's."""
    design = device.design
    scene, tube = held_scene(device, diameter=design.nominal_diameter, friction=friction, timestep=HELD_TIMESTEP)
    backend = NativeDevice(scene, device_tables(scene, [tube]))
    commands, rows = np.full((1, len(device.controls)), design.bellows.preload), []
    commands[:, 0] = rpm
    for number in range(round(HELD_SECONDS / HELD_TIMESTEP)):
        backend.step(commands, 1)
        if number * HELD_TIMESTEP >= HELD_SETTLED:
            rows.append((*backend.tendons()[0], *backend.loads()[0, : 2 * TRACKS]))
    lengths, loads = np.array(rows)[:, 0], np.array(rows)[:, 1:]
    pulled, point = tension(scene, lengths), drive_point(design, friction, rpm)
    cycle = 60 / (rpm * design.worm.starts) / HELD_TIMESTEP
    whole = round(int(len(rows) / cycle) * cycle)
    track = loads[:whole, :2].sum(axis=1)
    angles = np.exp(-2j * np.pi / cycle * np.arange(whole))
    stresses = tip_stresses(design, float(loads.mean()))
    return {
        "rpm": rpm,
        "force_N": float(pulled.mean()),
        "difference": float(pulled.mean() / point.force - 1),
        "ripple": float(pulled.std() / pulled.mean()),
        "track_ripple": float(2 * abs(((track - track.mean()) * angles).mean()) / track.mean()),
        "stress_mean_kPa": float(stresses.mean()) / 1e3,
        "stress_peak_kPa": float(stresses.max()) / 1e3,
        "slip_power_W": float(pulled.mean()) * point.speed,
    }


def tip_stresses(design: TrackedDesign, load: float) -> Float[np.ndarray, " phases"]:
    """Stress of the belt above a tip that presses with a load [N], at each tooth phase of the reference [Pa]."""
    table = load_table(design.tread)
    rows = zip(table.forces, table.stresses, strict=True)
    return np.array([np.interp(load, np.r_[0.0, forces], np.r_[0.0, stresses]) for forces, stresses in rows])
