"""A cohort of virtual patients as a question for studies: what an insertion shows in each of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from haustra.envs.control.laws import driver_settings
from haustra.envs.learning.find import find_policy, policy_settings
from haustra.envs.learning.hands import PolicySettings, require_shown
from haustra.envs.learning.policy import MlpPolicy
from haustra.envs.study.clinic_pain import HURTS, SITES
from haustra.envs.study.patients import Patient, left_as_they_are, patient_variables
from haustra.envs.study.questions import Question
from haustra.envs.study.study import Column, Sampler, Study, Value
from haustra.errors import InvalidOptionError, InvalidStudyError
from haustra.fields import number
from haustra.models.anatomy.landmarks import SEGMENTS
from haustra.models.devices.scope.files import find_design

OWN_DEVICE = "own"
"""Name of the device that a policy was trained with, and that other drivers take: the adult scope."""
LOOPS = ("N", "alpha", "reversed_alpha", "deep_transverse", "gamma")
"""Loops, as `haustra.envs.runs.measure.loops.LoopKind` names them."""

SCORES = (
    Column("outcome", "text", "why the run ended"),
    Column("sex", "text", "female or male"),
    Column("reach", "1", "how far the tip came, as a share of the colon's length"),
    Column("caecum", "1", "1 where the tip came past the valve"),
    Column("time_s", "s", "time to that, or to the end"),
    Column("descending_s", "s", "time to the middle of the descending colon; nothing where the tip never came there"),
    Column("flexure_s", "s", "time to the splenic flexure; nothing where the tip never came there"),
    Column("mesentery_peak_N_m", "N/m", "largest tension of the mesentery, seen once a second"),
    Column("inserted_m", "m", "shaft inside when the tip came past the valve"),
    Column("half_metre", "1", "1 where the tip was at or past the splenic flexure with 50 cm inside or less"),
    Column("any_loop", "1", "1 where a loop stood for long enough"),
    Column("n_loop", "1", "1 where an N loop did"),
    *(Column(f"loop_{kind}_s", "s", f"how long a loop of kind {kind} stood") for kind in LOOPS),
    *(Column(f"at_flexure_{kind}", "1", "1 where it stood when the tip came to the splenic flexure") for kind in LOOPS),
    Column("looped_share", "1", "share of the time with a loop"),
    Column("push_peak_N", "N", "largest push of the hand, at 10 Hz"),
    Column("pull_peak_N", "N", "largest pull"),
    Column("torque_peak_Nm", "N m", "largest torque either way"),
    Column("torque_clockwise_Nm", "N m", "largest torque clockwise"),
    Column("torque_anticlockwise_Nm", "N m", "largest torque anticlockwise"),
    Column("strong_share", "1", "share of the time with more than 9.8 N on the hand"),
    *(Column(f"axial_{name}_N", "N", f"mean size of the hand's force with the tip in the {name}") for name in SEGMENTS),
    Column("straightenings", "1", "times that 3 cm of shaft and more were drawn out"),
    *(Column(f"pain_{site}", "1", f"1 where it hurt at the {site} site") for site in SITES),
    *(Column(f"pain_{site}_s", "s", f"how long it hurt at the {site} site") for site in SITES),
    *(Column(f"pain_{cause}_s", "s", f"how long what hurt was: {cause.replace('_', ' ')}") for cause in HURTS),
    Column("pain_dose_s", "s", "time integral of the worst site's tension over what hurts, less 1 where it is more"),
    Column("p_perforation", "1", "share of people whose colon would have been torn"),
    Column("load_peak", "1", "largest load of the wall over the median person's strength"),
    Column("load_s", "s", "when the wall bore most of its strength"),
    Column("load_from_tip_m", "m", "how much colon behind the tip that was"),
)


@dataclass(frozen=True)
class CohortOptions:
    """How a cohort is examined."""

    seconds: float = number("s", 1.0, 3600.0, default=960.0)
    """Longest insertion [s]: a caecum reached within 16 min counts as a quality bar."""
    timestep: float = number("s", 1e-5, 0.02, default=0.005)
    """Integration step [s]."""
    precision: Literal["single", "double"] = "single"
    """Precision of the numbers that patients are stepped with."""
    rooted: bool = True
    """Whether mesenteries hang from their roots; otherwise from where colons were imaged, as in other runs."""
    stiffen_in: Literal["never", "descending", "transverse", "ascending"] = "never"
    """Segment from whose beginning on a scope's stiffening ring is turned to its stiffest setting, once the shaft was
    straightened there."""
    gas: float | None = number("Pa", 500.0, 6000.0, default=None)
    """Pressure that colons are filled to at the start, and that gas is let in up to [Pa]; where it is less than the one
    that a colon was grown at (`patient.gas_pressure`), the colon is narrower and draws together. When None, colons are
    as wide as they were grown throughout."""
    water: float | None = number("m^3", 0.0, 2e-3, default=None)
    """Water in rectum and sigmoid at the start [m^3], with gas only; none when None."""


@dataclass(frozen=True)
class Preset:
    """A cohort by name."""

    patients: int
    seconds: float
    title: str


PRESETS = {
    "quick": Preset(24, 600.0, "Two dozen virtual patients"),
    "full": Preset(400, 960.0, "Four hundred virtual patients"),
}


def cohort_study(
    name: str,
    *,
    drivers: tuple[str, ...] = ("endoscopist",),
    devices: tuple[str, ...] = (OWN_DEVICE,),
    patients: int | None = None,
    seconds: float | None = None,
    seed: int = 0,
    rooted: bool = True,
) -> Study:
    """The study of a cohort: patients by a Latin hypercube, each examined by every driver with every device.

    Args:
        name: quick or full.
        drivers: who drives: names of `haustra.envs.control.laws.DRIVERS`, files of their settings, policies.
        devices: names of scopes, or their files; `OWN_DEVICE` for what each driver takes.
        patients: how many; as the preset has when None.
        seconds: longest insertion [s]; as the preset has when None.
        seed: of the hypercube.
        rooted: whether mesenteries hang from their roots.

    Raises:
        InvalidOptionError: when a name is not known.
    """
    if name not in PRESETS:
        raise InvalidOptionError(f"Cohort '{name}' is not known. Known: {', '.join(PRESETS)}.")
    preset = PRESETS[name]
    study = Study(
        question="cohort",
        title=preset.title,
        base="default",
        variables=patient_variables(),
        conditions={"driver": tuple(drivers), "device": tuple(devices)},
        objectives=(),
        sampler=Sampler(kind="latin-hypercube", count=patients or preset.patients, seed=seed),
        options={"seconds": seconds or preset.seconds, "timestep": CohortOptions().timestep, "rooted": rooted},
    )
    for driver in drivers:
        for device in devices:
            check(study, {}, {"driver": driver, "device": device})
    return study


@dataclass(frozen=True)
class Examiner:
    """Who examines, and with what."""

    settings: Any
    """Settings of a law, or how a policy's actions are taken."""
    policy: MlpPolicy | None
    """None where a law drives."""
    device: str
    """Name or file of the scope."""

    @classmethod
    def of(cls, conditions: Mapping[str, Value]) -> "Examiner":
        """The driver and device of those names.

        Raises:
            InvalidOptionError: when the driver is not known, or its settings are out of range.
            InvalidDesignError: when the device is not known.
            UnreadableFileError: when a file cannot be read.
            UnsupportedSceneError: when the policy sees what a cohort does not show.
        """
        driver, device = str(conditions["driver"]), str(conditions["device"])
        policy = find_policy(driver)
        if policy is not None:
            require_shown(policy)
        settings = driver_settings(driver, moves=True) if policy is None else policy_settings(driver, policy)
        if device == OWN_DEVICE:
            device = "adult" if policy is None else policy.config.design
        find_design(device)
        return cls(settings, policy, device)

    @property
    def batch(self) -> tuple[str, str]:
        """What those have in common who may drive in one batch."""
        alike = type(self.settings).__name__
        return self.device, self.settings.policy if isinstance(self.settings, PolicySettings) else alike


def patient_of(study: Study, variables: Mapping[str, float]) -> Patient:
    """The patient of a job's variables, with what the study changes.

    Raises:
        InvalidStudyError: when something is to differ that patients do not have.
    """
    known = {variable.path: variable for variable in (*patient_variables(), *left_as_they_are())}
    for path in (*study.changes, *(variable.path for variable in study.variables)):
        if path not in known:
            raise InvalidStudyError(f"'{path}' is not known. Known: {', '.join(known)}.")
    changed = {known[path].name: value for path, value in study.changes.items()}
    return Patient.of({**changed, **variables})


def check(study: Study, variables: Mapping[str, float], conditions: Mapping[str, Value]) -> Patient:
    """The patient, once driver and device are known to exist.

    Raises:
        HaustraError: as `Examiner.of` and `patient_of`; when there is water, but no pressure of the gas beside it.
    """
    Examiner.of(conditions)
    if study.options.get("water") and study.options.get("gas") is None:
        raise InvalidStudyError("options.water: water stands beside gas: give its pressure, options.gas.")
    return patient_of(study, variables)


QUESTION = Question(
    scores=SCORES,
    conditions={
        "driver": Column("driver", "text", "who drives: a name, a file of settings, or a policy"),
        "device": Column("device", "text", "scope: a shipped name, a file, or own"),
    },
    options=CohortOptions,
    check=check,
)
