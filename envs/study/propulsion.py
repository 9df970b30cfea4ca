"""What a tracked robot pulls, as a question for studies: steady force, ripple, torque, normal force and stress."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Complex, Float

from haustra.envs.runs.measure.propulsion import Pull, pull_model
from haustra.envs.study.paths import with_values
from haustra.envs.study.questions import Backend, Question, Runner, one_by_one
from haustra.envs.study.study import Column, Job, Result, Study, Value
from haustra.errors import InvalidDesignError, InvalidOptionError, InvalidStudyError
from haustra.fields import number
from haustra.models.devices.tracked.design import TRACKS, TrackedDesign
from haustra.models.devices.tracked.drive import track_normal
from haustra.models.devices.tracked.law import TreadTable, load_law, load_table
from haustra.models.devices.tracked.rig import TIMESTEP, TUBE_TIMESTEP, Rig, flat_rig, tube_rig

CURVE_POINTS = 24
"""Places in a pitch at which the force curve is given; the law's third harmonic has eight of them to a period."""

SCORES = (
    Column("force_N", "N", "mean propulsion of all four tracks"),
    Column("ripple_N", "N", "amplitude of a track's propulsion at the tooth-passing frequency (tube: of the device's)"),
    Column("ripple_fraction", "1", "root of the sum of squares of its first three harmonics, over its mean"),
    Column("device_ripple_fraction", "1", "the same for the sum of four tracks, each with its tooth phase"),
    Column("ripple_Hz", "Hz", "tooth-passing frequency"),
    Column("normal_N", "N", "sum of the normal forces of all pads of four tracks"),
    Column("effective_friction", "1", "coefficient after speed dependence and shaft losses, if these are on"),
    Column("worm_torque_Nm", "N m", "torque of the worm for that force, at its assumed efficiency"),
    Column("roll_rad_s", "rad/s", "rate at which a free device turns in the tube; 0 on the flat rig"),
    Column("indentation_mm", "mm", "how deep each tip presses the tread into the tissue"),
    Column("stress_mean_kPa", "kPa", "stress of the belt above a tip, mean over a tooth's passage (reference table)"),
    Column("stress_peak_kPa", "kPa", "its largest value over a tooth's passage"),
    Column("beyond_table", "1", "1 where the tip presses deeper than the reference table, and stresses are left out"),
    Column("touching", "1", "share of the time for which the pad that lifts most touches"),
)


@dataclass(frozen=True)
class TabulatedColon:
    """A design under its conditions, ready to be put on a rig."""

    design: TrackedDesign
    speed: float
    """[m/s]."""
    friction: float
    """Effective [1]."""
    indentation: float
    """[m]."""
    table: TreadTable


@dataclass(frozen=True)
class Steady:
    """What is read from a steady run, by whatever backend."""

    force: float
    """Mean friction of all pads along the track [N]."""
    normal: float
    """Mean sum of all pads' normal forces [N]."""
    string: float
    """Mean tension of the string; the friction itself on a fixed core [N]."""
    ripple: Float[np.ndarray, " harmonics"]
    """Amplitudes of the friction at the tooth-passing frequency and its multiples [N]."""
    waves: Complex[np.ndarray, " harmonics"]
    """Amplitudes and phases of what pulls, string or friction [N]."""
    tooth_frequency: float
    """[Hz]."""
    roll: float
    """Roll rate of a core that is free to turn [rad/s]."""
    touching: float
    """Share of the time for which the pad that lifts most touches the wall."""


@dataclass(frozen=True)
class PropulsionStudyOptions:
    """How the tracked robot is pulled."""

    rig: Literal["flat", "tube"] = "flat"
    """One track on flat tissue, or the whole device in its tube."""
    losses: bool = False
    """Friction falls with speed, and the shaft loses some of the drive."""
    timestep: float = number("s", 0.0, 0.02, default=0.0)
    """Integration step [s]; that of the rig when 0."""


def build_case(study: Study, variables: Mapping[str, float], conditions: Mapping[str, Value]) -> TabulatedColon:
    """The design with the variables applied, and what its conditions ask of it.

    Paths: `design.*` are fields of `TrackedDesign`; `drive.starts` sets the worm's starts and with them pitch and tooth
    width, since the lead is starts times pitch and a tooth is half a pitch; `drive.spacing_pitches` the tip spacing in
    pitches; `condition.friction` and `condition.speed` replace a condition.

    Raises:
        InvalidDesignError: when the design is impossible, presses nothing, or has no force table.
        InvalidOptionError: when a condition cannot be honoured.
        InvalidStudyError: when a path is not known.
    """
    if study.base not in ("default", "prototype"):
        raise InvalidStudyError(f"Design '{study.base}' is not known. Known: prototype")
    paths = {variable.name: variable.path for variable in study.variables}
    changes = {**study.changes, **{paths[name]: value for name, value in variables.items()}}
    fields, drive, under = {}, {}, {name: float(value) for name, value in conditions.items()}
    for path, value in changes.items():
        room, _, rest = path.partition(".")
        if room == "design" and rest:
            fields[rest] = value
        elif path in ("drive.starts", "drive.spacing_pitches"):
            drive[rest] = value
        elif path in ("condition.friction", "condition.speed"):
            under[rest] = value
        else:
            raise InvalidStudyError(
                f"'{path}' is not known. Known: design.<field>, drive.starts, drive.spacing_pitches, "
                "condition.friction, condition.speed"
            )
    pressed = _pressed(tuple(fields.items()), tuple(drive.items()))
    design = pressed.design
    friction, speed = under["friction"], under["speed"]
    if not 0 < friction <= 2:
        raise InvalidOptionError(f"Friction is {friction:g}: give a coefficient above 0, up to 2.")
    if not 0 < speed <= 1:
        raise InvalidOptionError(f"Speed is {speed:g} m/s: give one above 0, up to 1 m/s.")
    if study.options["losses"]:
        friction *= design.speed_friction.factor(speed)
        friction *= design.shaft.transmission(speed / design.worm.lead * math.tau)
        if friction <= 0:
            raise InvalidDesignError(f"At {speed * 1e3:.1f} mm/s the shaft's losses leave nothing of the drive.")
    needed = friction * TRACKS * pressed.normal * _lever(design)
    if needed > design.worm.torque_limit:
        raise InvalidDesignError(
            f"The worm would need {needed:.3g} N m, more than the shaft's {design.worm.torque_limit:.3g} N m."
        )
    return TabulatedColon(design, speed, friction, pressed.indentation, load_table(design.tread))


@dataclass(frozen=True)
class _Pressed:
    """A design, and how it presses: what does not depend on its conditions."""

    design: TrackedDesign
    normal: float
    """Normal force of one track [N]."""
    indentation: float
    """[m]."""


@lru_cache(maxsize=1024)
def _pressed(fields: tuple[tuple[str, float], ...], drive: tuple[tuple[str, float], ...]) -> _Pressed:
    """The prototype with these fields and drive, kept for its next conditions.

    Raises:
        InvalidDesignError: when the design is impossible, presses nothing, or has no force table.
        InvalidStudyError: when a field is not known.
    """
    design = _with_drive(TrackedDesign(), dict(drive))
    design = with_values(design, dict(fields)) if fields else design
    normal = track_normal(design, design.nominal_diameter)
    if normal <= 0:
        raise InvalidDesignError(
            f"Bellows at {design.bellows.pressure:.4g} Pa lift the tracks off the wall: lower the pressure."
        )
    return _Pressed(design, normal, load_law(design.tread).indentation(normal / 2))


def _with_drive(design: TrackedDesign, drive: Mapping[str, float]) -> TrackedDesign:
    starts, spacing = drive.get("starts", design.worm.starts), drive.get("spacing_pitches")
    if starts != int(starts) or not 1 <= starts <= 100:
        raise InvalidDesignError(f"A worm of {starts:g} starts: give a whole number from 1.")
    pitch = design.worm.lead / starts
    spacing = design.tread.spacing_in_pitches if spacing is None else spacing
    tread = replace(design.tread, pitch=pitch, tooth_width=pitch / 2, tip_spacing=spacing * pitch)
    return replace(design, tread=tread, worm=replace(design.worm, starts=int(starts)))


def touches_too_little(touching: float, step: float) -> str:
    """Why a run counts as diverged."""
    return (
        f"A value is not finite, or a pad touched for {touching:.0%} of the time: "
        f"lower options.timestep{f' of {step:g} s' if step else ''}."
    )


def answer(study: Study, job: Job) -> Result:
    """Pull one design under one set of conditions."""
    case = build_case(study, job.variables, job.conditions)
    rig, step = rig_of(study, case), float(study.options["timestep"])
    model = rig.spec.compile()
    rig.tracked.set_speed(model, case.speed)
    torque = roll_torque(case) if rig.string else 0.0
    run = pull_model(model, rig, case.speed, roll_torque=torque)
    if run.outcome == "diverged":
        return Result(job.id, "diverged", reason=touches_too_little(run.touching, step))
    return result_of(job, case, _steady(run, whole=bool(rig.string)), whole=bool(rig.string))


def roll_torque(case: TabulatedColon) -> float:
    """Torque of the worm on a device in its tube [N m]: friction of all tracks, less its own part, times the lever."""
    lever = _lever(case.design)
    grip = case.friction * TRACKS * track_normal(case.design, case.design.nominal_diameter)
    return lever * grip / math.hypot(1.0, 2 * lever / case.design.nominal_diameter)


def result_of(job: Job, case: TabulatedColon, run: Steady, *, whole: bool) -> Result:
    """A finished job's row; `whole` for a device in its tube, otherwise one track of four."""
    return Result(job.id, "finished", scores=_scores(case, run, whole=whole), curves=_curves(run, whole=whole))


def _steady(run: Pull, *, whole: bool) -> Steady:
    pulling = run.string if whole else run.force
    angles = math.tau * run.tooth_frequency * run.timestep * np.arange(len(pulling))
    return Steady(
        force=run.mean,
        normal=float(run.normal.mean()),
        string=float(run.string.mean()),
        ripple=run.ripple(),
        waves=np.array([2 * (pulling * np.exp(-1j * order * angles)).mean() for order in (1, 2, 3)]),
        tooth_frequency=float(run.tooth_frequency),
        roll=float(run.roll),
        touching=float(run.touching),
    )


def _lever(design: TrackedDesign) -> float:
    """Worm torque over propulsion [m]."""
    return design.worm.lead / (math.tau * design.worm.efficiency)


def rig_of(study: Study, case: TabulatedColon) -> Rig:
    """The rig that a study's options ask for."""
    step = float(study.options["timestep"])
    if study.options["rig"] == "tube":
        return tube_rig(case.design, friction=case.friction, timestep=step or TUBE_TIMESTEP)
    return flat_rig(case.design, friction=case.friction, indentation=case.indentation, timestep=step or TIMESTEP)


def _scores(case: TabulatedColon, run: Steady, *, whole: bool) -> dict[str, Value | None]:
    share = 1 if whole else TRACKS  # the flat rig holds one track of four
    force = run.string if whole else share * run.force
    fractions = run.ripple / run.force
    # Harmonic n of four equal tracks out of phase by starts x azimuth survives where n x starts is a multiple of four.
    order = np.arange(1, len(run.ripple) + 1)
    together = np.ones(len(run.ripple), bool) if whole else order * case.design.worm.starts % TRACKS == 0
    stress = _stress(case)
    return {
        "force_N": force,
        "ripple_N": float(run.ripple[0]),
        "ripple_fraction": float(np.sqrt((fractions**2).sum())),
        "device_ripple_fraction": float(np.sqrt((fractions[together] ** 2).sum())),
        "ripple_Hz": run.tooth_frequency,
        "normal_N": share * run.normal,
        "effective_friction": float(case.friction),
        "worm_torque_Nm": force * _lever(case.design),
        "roll_rad_s": run.roll,
        "indentation_mm": case.indentation * 1e3,
        "stress_mean_kPa": None if stress is None else float(stress.mean()) / 1e3,
        "stress_peak_kPa": None if stress is None else float(stress.max()) / 1e3,
        "beyond_table": float(stress is None),
        "touching": run.touching,
    }


def _stress(case: TabulatedColon) -> Float[np.ndarray, " phases"] | None:
    """Mean von Mises stress of the belt at each tooth phase [Pa]; None beyond the table's deepest indentation."""
    table = case.table
    if case.indentation > table.indentations[-1]:
        return None
    depths, stresses = np.r_[0.0, table.indentations], np.c_[np.zeros(len(table.phases)), table.stresses]
    return np.array([np.interp(case.indentation, depths, row) for row in stresses])


def _curves(run: Steady, *, whole: bool) -> dict[str, list[float]]:
    """Propulsion over a tooth's passage, from the mean and the first three harmonics at their phases."""
    places = math.tau * np.arange(CURVE_POINTS) / CURVE_POINTS
    curve = np.full(CURVE_POINTS, run.string if whole else run.force)
    for order, wave in enumerate(run.waves, start=1):
        curve = curve + (wave * np.exp(1j * order * places)).real
    name = "force_N" if whole else "force_per_track_N"
    return {
        "passage_pitches": [float(value) for value in np.round(places / math.tau, 6)],
        name: [float(value) for value in np.round(curve, 9)],
    }


def _start(study: Study, folder: Path) -> Runner:
    return one_by_one(lambda job: answer(study, job))


QUESTION = Question(
    scores=SCORES,
    conditions={
        "friction": Column("friction", "1", "Coulomb's coefficient between tread and wall"),
        "speed": Column("speed_m_s", "m/s", "speed of the treads relative to the core"),
    },
    options=PropulsionStudyOptions,
    check=build_case,
)
NATIVE = Backend(start=_start, batch=32)
