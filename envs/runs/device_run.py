"""One run of any device: driven by its own driver until it is through, out, lost or out of time, and scored."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float

from haustra.envs.runs.insertion import CONTROL_INTERVAL, Progress
from haustra.envs.runs.measure.device_burden import DeviceMeter
from haustra.envs.runs.measure.injury import by_site, perforation_scores
from haustra.envs.runs.measure.progress import segment_at
from haustra.envs.runs.outcome import CAECUM_MARGIN, ESCAPE_DEPTH, Outcome
from haustra.envs.sim.device_native import DeviceGas, NativeDevice
from haustra.envs.sim.moved_colon import CurrentColon
from haustra.models.accuracy import NumericalError, kind_of
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.lumen_meshes import add_lumen
from haustra.models.device_accuracy import stated_device_error
from haustra.models.device_scene import DeviceScene, build_device_scene, device_options, device_tables, pose_in
from haustra.models.devices.base import Device, DeviceReadings, Reading
from haustra.models.injury.perforation import link_load, worst_load
from haustra.models.scene import SceneOptions
from haustra.models.wall.lumen_table import pick
from haustra.models.wall.moving_colon import POSE
from haustra.models.wall.pieces.wall import Wall

PATIENCE = 10.0
"""A run whose time is up was stuck when it made less than `HEADWAY` in this time [s]."""
HEADWAY = 0.005
"""A run comes further when its tip does by this much [m]; engineering choice."""

Pilot = Callable[[DeviceReadings, dict[str, Any]], Float[np.ndarray, "1 channels"]]
"""Commands for what every device tells and for its own readings, asked for at every control interval of the run."""

Records = Mapping[str, Any]
"""What was recorded at every control interval, by name: `time` [s], `tip_arc` [m], `wall_force` [N], `deepest` [m] and
own readings of the device, each (records,); where known `tip` (records, 3), `tip_frame` (records, 3, 3), `qpos`,
`ctrl`, `wall_force_sum` of all bodies [N], the largest `wall_pressure` [Pa], `power` that drives the device [W],
`colon_moved`, the farthest that a place of the colon is from where it was at rest [m], `mesentery_extension`, the
farthest that the mesentery is drawn out beyond its slack [m], `pain` (records, stations) [1], `displacement` (records,
nodes, 7) of the colon's axis, without nodes where it is fixed, and `mocap_pos` and `mocap_quat` of the bodies on which
pieces of a wall that moves stand."""


@dataclass(frozen=True)
class DeviceRun:
    """A finished run of any device."""

    device: Device
    outcome: Outcome
    records: Records
    shape: Float[np.ndarray, "points 3"]
    """Spheres as thick as its nose, at the end, from its rear on, in the colon's coordinates [m]."""
    radius: float
    """Radius of the device, to draw it [m]."""
    tip: str
    """Site at its nose, its z axis forwards."""
    trail: tuple[str, float] | None
    """Site that its tether hangs on, and the tether's radius [m]; None without one."""
    scene: DeviceScene
    """What was run."""
    spec: mujoco.MjSpec
    """Its spec, with the lumen as a picture, in the colon's coordinates."""
    wall_clock: float
    """Time that stepping and deciding took [s]."""
    backend: str
    rest: Colon
    """The colon at rest."""
    colon: Colon
    """The colon as it lies at the end."""
    wall_law: str
    mesentery: bool
    left_out: Mapping[str, str]
    configuration: Mapping[str, object]
    """Every option that shaped the run; JSON values only."""


def run_device(
    device: Device,
    colon: Colon,
    options: SceneOptions | None = None,
    *,
    seconds: float,
    wall: Wall | None = None,
    patience: float | None = None,
    pilot: Pilot | None = None,
    driver: str = "the device's own",
    progress: Progress | None = None,
) -> DeviceRun:
    """Let a device's own driver, or a pilot, drive it for up to `seconds` of simulated time, natively.

    With `patience` [s] a run that comes no further for so long is stuck, and ends. `wall` is the colon's, of pieces,
    for scenes of that wall law; `pilot` has driven no other run; `driver` is what it is called in the run's record.

    Raises:
        InvalidOptionError: when pieces are asked for and no wall is given.
        UnsupportedSceneError: naming what the device or its scene does not honour.
    """
    options = options or device_options(device)
    scene = build_device_scene(device, options, pose=pose_in(colon, device, options), colon=colon, wall=wall)
    tables = device_tables(scene, [colon])
    backend = NativeDevice(scene, tables)
    if options.gas is not None:
        backend.fill(DeviceGas(colon, options, tables))
    steps = max(1, round(CONTROL_INTERVAL / options.timestep))
    meter, rows = DeviceMeter(scene, colon), list[dict[str, Any]]()
    furthest, since = -np.inf, 0.0
    memory, outcome, shape = np.zeros(1), None, backend.spheres()[0]
    seen = backend.read()
    began = time.perf_counter()
    while outcome is None and seen.time[0] < seconds - steps * options.timestep / 2:
        if pilot is None:
            commands, memory = device.drive(np, seen, memory)
        else:
            commands = pilot(seen, backend.readings())
        if not backend.step(commands, steps).all():
            outcome = Outcome.DIVERGED
            break
        seen, shape = backend.read(), backend.spheres()[0]
        qpos, ctrl = backend.positions()
        row = {
            name: getattr(seen, name)[0] for name in ("time", "tip", "tip_frame", "tip_arc", "wall_force", "deepest")
        }
        own = {name: value[0] for name, value in backend.readings().items()}
        borne = _borne(backend, meter)
        places, turns = backend.mocap()
        told = {"qpos": qpos[0], "ctrl": ctrl[0], "commands": commands[0], "mocap_pos": places, "mocap_quat": turns}
        rows.append({**row, **own, **borne, **told})
        outcome = ended(row, colon.centreline.length)
        if row["tip_arc"] > furthest + HEADWAY:
            furthest, since = float(row["tip_arc"]), float(row["time"])
        if patience and outcome is None and row["time"] - since > patience:
            outcome = Outcome.STUCK
        if progress and len(rows) % 25 == 0:
            progress(float(seen.time[0]), float(seen.tip_arc[0]))
    records = {name: np.array([row[name] for row in rows]) for name in rows[0]} if rows else _nothing(device)
    spec = scene.spec.copy()
    rest = colon
    if (moved := backend.displacement) is not None:
        colon = CurrentColon(colon, pick(tables, np.zeros(1, int)), np.zeros(3), np.eye(3)).colon(moved[0])
    if backend.gas is not None:
        colon = backend.gas.run.colon(colon)
        filled = backend.gas.run.record(len(rows))._asdict()
        records = {**records, **{f"gas_{name}": values for name, values in filled.items()}}
    thick = scene.groups == scene.groups[-1]
    add_lumen(spec, colon, group=1)
    return DeviceRun(
        device=device,
        outcome=outcome or time_is_up(records),
        records=records,
        shape=shape[thick],
        radius=scene.handles.samples[-1].radius,
        tip=scene.handles.tip,
        trail=scene.handles.trail,
        scene=scene,
        spec=spec,
        wall_clock=time.perf_counter() - began,
        backend=backend.name,
        rest=rest,
        colon=colon,
        wall_law=options.wall_law,
        mesentery=options.mesentery,
        left_out=scene.left_out,
        configuration={**scene.configuration(), "seconds": seconds, "driver": driver},
    )


def _borne(backend: NativeDevice, meter: DeviceMeter) -> dict[str, Any]:
    """What the colon bears now, and what is put into the device."""
    forces, displacement = backend.body_forces(), backend.displacement
    poses = np.zeros((0, POSE), np.float32) if displacement is None else displacement[0].astype(np.float32)
    moved = 0.0 if displacement is None else np.linalg.norm(displacement[0, :, :3], axis=1).max()
    time = backend.read().time
    return {
        "wall_force_sum": forces[0].sum(),
        "wall_pressure": meter.pressure(forces)[0],
        "power": backend.power()[0],
        "colon_moved": moved,
        "displacement": poses,
        "mesentery_extension": meter.extension(displacement, time)[0],
        "pain": meter.pain(forces, backend.body_arcs(), displacement, time)[0],
    }


def ended(row: Mapping[str, Any], length: float) -> Outcome | None:
    """Why a run ends with this record in a colon of that length [m]; None while it goes on."""
    if row["deepest"] > ESCAPE_DEPTH:
        return Outcome.ESCAPED
    return Outcome.COMPLETED if row["tip_arc"] >= length - CAECUM_MARGIN else None


def time_is_up(records: Records) -> Outcome:
    """How a run ended that nothing else ended: it was stuck if it came no further lately."""
    at, arc = records["time"], records["tip_arc"]
    if not len(at) or at[-1] < PATIENCE:
        return Outcome.TIME_UP
    late = at > at[-1] - PATIENCE
    before = float(arc[~late].max(initial=0.0))
    return Outcome.STUCK if arc[late].max() - before < HEADWAY else Outcome.TIME_UP


def common_scores(
    outcome: Outcome, records: Records, readings: tuple[Reading, ...], colon: Colon, radius: float
) -> dict[str, Any]:
    """Scores that make sense for any device, and mean and peak of its own readings, as plain JSON values.

    `wall_force` is the largest resultant normal force of the wall on one body of the device; `outside_max_mm` how deep
    its surface stood in the wall at rest, negative for room; `reach` how far its tip came over the colon's length.
    `p_perforation` takes the hardest pressed body for a straight head of the device's nose's radius [m], where the tip
    is; a run that ended as escaped has torn the wall.
    """
    count = len(records["time"])

    def of(name: str, pick: Callable[[np.ndarray], Any], otherwise: float = 0.0) -> float:
        return float(pick(np.asarray(records[name]))) if count else otherwise

    furthest = of("tip_arc", np.max)
    scores: dict[str, Any] = {
        "outcome": outcome.value,
        "simulated_s": of("time", np.max),
        "tip_arc_m": of("tip_arc", lambda arc: arc[-1]),
        "tip_arc_max_m": furthest,
        "reach": min(max(furthest / colon.centreline.length, 0.0), 1.0),
        **perforation_scores(*_worst(outcome, records, radius), colon),
        "wall_force_peak_N": of("wall_force", np.max),
        "wall_force_mean_N": of("wall_force", np.mean),
        "outside_max_mm": 1e3 * of("deepest", np.max),
    }
    for reading in readings:
        mean, peak = reading_columns(reading)
        scores[mean] = of(reading.name, np.mean)
        scores[peak] = of(reading.name, lambda values: np.abs(values).max())
    return scores


def _worst(outcome: Outcome, records: Records, radius: float) -> tuple[float, float]:
    """Largest load of the wall over its strength, and where the tip was then."""
    if not len(records["time"]):
        return 0.0, 0.0
    load = link_load(np, np.asarray(records["wall_force"], float), 0.0, True, 2 * radius)
    arc, most = np.asarray(records["tip_arc"], float), int(load.argmax())
    found = worst_load(np, (load[most], arc[most]), load[-1], arc[-1], outcome is Outcome.ESCAPED)
    return float(found[0]), max(float(found[1]), 0.0)


def reading_columns(reading: Reading) -> tuple[str, str]:
    """Names of the scores that hold mean and peak of a reading, with its unit."""
    unit = "" if reading.unit == "1" else "_" + reading.unit.replace("/", "_").replace(" ", "")
    return f"{reading.name}_mean{unit}", f"{reading.name}_peak{unit}"


def device_scores(run: DeviceRun, colon: Colon, *, error: NumericalError | None = None) -> dict[str, Any]:
    """All scores of a run but its provenance, as plain JSON values.

    The numerical error is that of the run itself where it was measured, otherwise that of other runs of its kind.
    """
    options = device_options(
        run.device, wall_law=run.wall_law, mesentery=run.mesentery, timestep=float(run.spec.option.timestep)
    )
    error = error or stated_device_error(run.device, options, kind_of(colon))
    found = common_scores(run.outcome, run.records, run.device.readings, colon, run.radius)
    simulated = found["simulated_s"]
    return {
        "device": run.device.name,
        "device_kind": run.device.kind,
        **found,
        "advice": run.outcome.advice,
        "warnings": list(colon.warnings),
        "tip_segment": segment_at(colon, found["tip_arc_m"]),
        "tip_segment_max": segment_at(colon, found["tip_arc_max_m"]),
        **burden_scores(run.records, colon),
        "colon_length_m": colon.centreline.length,
        "wall_clock_s": run.wall_clock,
        "real_time_factor": simulated / run.wall_clock if run.wall_clock > 0 else 0.0,
        "backend": run.backend,
        "wall_law": run.wall_law,
        "mesentery": run.mesentery,
        "numerical_error": error.to_json(),
        "timestep_s": float(run.spec.option.timestep),
        "not_modelled": dict(run.left_out),
    }


def burden_scores(records: Records, colon: Colon) -> dict[str, Any]:
    """What the colon bore in a whole run, as plain JSON values.

    `wall_impulse_N_s_m` is the sum of wall forces over time per metre that the tip gained, null where it gained none;
    `colon_moved_peak_mm` how far a colon on its mesentery was moved at most, `mesentery_extension_peak_mm` how far the
    mesentery was drawn out beyond its slack, both with means over time, `work_J` what the actuators that drive put in;
    `pain_*` as of scopes (`haustra.envs.runs.measure.injury.injury_scores`).
    """
    time = np.asarray(records["time"], float)
    if not len(time):
        return {}
    interval, arcs = float(time[0]), np.asarray(records["tip_arc"], float)
    gained, peak = float(arcs.max() - arcs[0]), np.asarray(records["pain"]).max(axis=0)
    return {
        "wall_force_sum_mean_N": float(np.mean(records["wall_force_sum"])),
        "wall_impulse_N_s_m": float(np.sum(records["wall_force_sum"])) * interval / gained if gained > 0 else None,
        "wall_pressure_peak_kPa": float(np.max(records["wall_pressure"])) / 1e3,
        "colon_moved_peak_mm": 1e3 * float(np.max(records["colon_moved"])),
        "colon_moved_mean_mm": 1e3 * float(np.mean(records["colon_moved"])),
        "mesentery_extension_peak_mm": 1e3 * float(np.max(records["mesentery_extension"])),
        "mesentery_extension_mean_mm": 1e3 * float(np.mean(records["mesentery_extension"])),
        "work_J": float(np.sum(records["power"])) * interval,
        "pain_peak": float(peak.max()),
        "pain_by_site": by_site(peak, colon),
    }


def _nothing(device: Device) -> dict[str, Any]:
    names = ("time", "tip_arc", "wall_force", "deepest", *(reading.name for reading in device.readings))
    return {name: np.zeros(0) for name in names}
