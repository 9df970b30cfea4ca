"""A cohort's patients as worlds of one program: driven, looked at ten times a second, and measured as in a clinic."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby, product
from pathlib import Path
from typing import Any, Literal

import numpy as np

from haustra.children import cores
from haustra.envs.control.endoscopist import ASSISTANT
from haustra.envs.control.held import HeldHand
from haustra.envs.learning.hands import BatchHands
from haustra.envs.runs.linear_insertions import LinearInsertions
from haustra.envs.runs.outcome import Outcome
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.gas import require_room
from haustra.envs.study.clinic_watch import EVERY, ClinicWatch
from haustra.envs.study.cohort import CohortOptions, Examiner, patient_of
from haustra.envs.study.costs import counted
from haustra.envs.study.patients import Patient, clinic_number, grow_patients
from haustra.envs.study.questions import Backend, Runner
from haustra.envs.study.sampling import designs_of
from haustra.envs.study.stiffening import NEVER, StiffeningRing
from haustra.envs.study.study import Job, Result, Study
from haustra.envs.tasks.case import case_of
from haustra.envs.tasks.ray_program import LumenSight, lookup_of
from haustra.envs.tasks.sight import Sight
from haustra.errors import HaustraError, UnsupportedSceneError
from haustra.models.anatomy.colon import Colon
from haustra.models.devices.scope.files import find_design
from haustra.models.devices.scope.library import at_body_temperature
from haustra.models.injury.perforation import Strength
from haustra.models.presets import PRESETS, TABLE
from haustra.models.scene import build_scene, entry_of
from haustra.models.wall import mesentery
from haustra.models.wall.abdomen import Abdomen
from haustra.models.wall.lumen_table import LumenTable, Tables, lumen_table, on_mesentery, stack

_JOBS = 16
"""Patients that one process examines at once: two rows of lanes, whose looks and lines of Python the core beside it can
spare, and what is lost when it is interrupted."""


PRECISIONS = {"single": np.float32, "double": np.float64}
"""What patients are stepped with, by name."""


def _start(study: Study, folder: Path, *, device: Literal["cpu", "cuda"]) -> Runner:
    def run(jobs: Sequence[Job]) -> Iterable[Result]:
        conditions = {_pair(job): job.conditions for job in jobs}
        pairs = {pair: Examiner.of(each) for pair, each in conditions.items()}

        def batch(job: Job) -> tuple[str, str]:
            return pairs[_pair(job)].batch

        for _, alike in groupby(sorted(jobs, key=batch), batch):
            examined = list(alike)
            yield from _examined(study, folder, examined, [pairs[_pair(job)] for job in examined], device)

    return run


def _pair(job: Job) -> tuple[str, str]:
    return str(job.conditions["driver"]), str(job.conditions["device"])


def _prepare(study: Study, folder: Path, tell: Callable[[str], None]) -> None:
    """Grow the patients' colons, on every core."""
    if study.sampler.kind == "latin-hypercube":
        patients = [Patient.of(design) for design in designs_of(study)]
        pairs = product(study.conditions["driver"], study.conditions["device"])
        devices = {Examiner.of({"driver": driver, "device": device}).device for driver, device in pairs}
        radii = {find_design(device).diameter / 2 for device in devices}

        def told(done: int) -> None:
            tell(f"growing patient {done} of {len(patients)}")

        with counted(folder, "growing"):
            grow_patients(patients, sorted(radii), processes=cores(), tell=told)


def _examined(
    study: Study, folder: Path, jobs: Sequence[Job], examiners: Sequence[Examiner], device: Literal["cpu", "cuda"]
) -> Iterable[Result]:
    """Results of patients who are examined in one batch, each by an examiner."""
    design, policy = at_body_temperature(find_design(examiners[0].device)), examiners[0].policy
    rooted = bool(study.options.get("rooted", CohortOptions.rooted))
    own, patients, sound, settings = _Colons(design.diameter / 2, rooted), [], [], []
    filled = _filled(study)
    for job, examiner in zip(jobs, examiners, strict=True):
        try:
            patient = patient_of(study, job.variables)
            own.take(patient, water=filled.get("water", 0.0))
        except HaustraError as error:
            yield Result(job.id, "failed", reason=" ".join(str(error).split()))
            continue
        patients.append(patient)
        sound.append(job)
        settings.append(examiner.settings)
    if not sound:
        return
    options = replace(
        PRESETS["balanced"].apply(law=TABLE),
        softening=False,
        mesentery=True,
        timestep=float(study.options["timestep"]),
        push_limit=clinic_number("hand_push"),
        torque_limit=clinic_number("hand_torque"),
        **filled,
    )
    longest = max(own.colons, key=lambda colon: colon.centreline.length)
    batch = LinearInsertions(
        build_scene(longest, None, design, options, show_lumen=False),
        together(own.tables),
        own.colons,
        worlds=len(sound),
        settings=HeldHand() if policy else settings,
        device=device,
        real=PRECISIONS[str(study.options.get("precision", CohortOptions.precision))],
        sees=LumenSight() if policy else None,
        lookup=lookup_of(Sight([case_of(colon, device_radius=own.radius) for colon in own.colons])) if policy else None,
    )

    def each(name: str) -> np.ndarray:
        return np.array([patient.values[name] for patient in patients])

    conditions = Conditions(each("friction"), each("wall_stiffness"), each("shaft_stiffness"))
    case = np.array(own.case)
    borne = zip(Strength._fields, np.array([patient.strength for patient in patients]).T, strict=True)
    batch.begin(case, conditions, {f"wall_{name}": values for name, values in borne})
    colons = [own.colons[which] for which in case]
    watch = ClinicWatch(batch, patients, colons, case)
    segment = str(study.options.get("stiffen_in", NEVER))
    ring = StiffeningRing(batch, colons, segment=segment)

    def look() -> None:
        watch()
        ring()

    hand = BatchHands(batch, policy, settings[0]) if policy else None
    with counted(folder, "stepping"):
        runs = batch.run(seconds=float(study.options["seconds"]), watch=look, every=EVERY, hand=hand)
    with counted(folder, "measuring"):
        scores = [watch.scores(index) for index in range(len(sound))]
    for index, job in enumerate(sound):
        if runs.outcome[index] is Outcome.DIVERGED:
            yield Result(job.id, "diverged", reason=runs.outcome[index].advice)
            continue
        about = {"outcome": runs.outcome[index].value}
        yield Result(job.id, "finished", scores=about | scores[index], curves=watch.curves(index))


def _filled(study: Study) -> dict[str, Any]:
    """Options of scenes by which gas and water move through colons, where the study has gas."""
    if (pressure := study.options.get("gas")) is None:
        return {}
    return {"gas": float(pressure), "gas_start": float(pressure), "water": float(study.options.get("water") or 0.0)}


def _prepare_gpu(study: Study, folder: Path, tell: Callable[[str], None]) -> None:
    """Refuse gas that moves, before anything is grown.

    Raises:
        UnsupportedSceneError: where there is such gas.
    """
    if _filled(study):
        raise UnsupportedSceneError("The backend 'linear-gpu' cannot honour options.gas; linear can.")
    _prepare(study, folder, tell)


class _Colons:
    """Colons of patients, each once whoever examines it."""

    def __init__(self, radius: float, rooted: bool) -> None:
        self.radius, self._rooted, self._seen = radius, rooted, dict[tuple, int]()
        self.colons: list[Colon] = []
        self.tables: list[list[Tables]] = []
        self.case: list[int] = []
        """Which colon each patient that was taken has."""

    def take(self, patient: Patient, *, water: float) -> None:
        """Tabulate a patient's colon, unless that was done.

        Raises:
            HaustraError: when it cannot be grown, or takes less than so much water [m^3].
        """
        known = tuple(sorted(patient.values.items()))
        if known not in self._seen:
            colon = patient.colon()
            require_room(colon, water)
            self.tables.append(tables_with_mesentery(patient, colon, self.radius, rooted=self._rooted))
            self.colons.append(colon)
            self._seen[known] = len(self._seen)
        self.case.append(self._seen[known])


def tables_with_mesentery(patient: Patient, colon: Colon, radius: float, *, rooted: bool) -> list[Tables]:
    """Tables of a patient's colon for a scope of that radius [m], one for each thing that an assistant may do."""
    table = lumen_table(colon, device_radius=radius)
    found = []
    for asked in ASSISTANT:
        around: Abdomen = replace(patient.abdomen, posture=asked.posture, pressed=asked.pressed, rooted=rooted)
        own = on_mesentery(table.tables, colon, around, changed=patient.mesentery)
        found.append(LumenTable(own, radius, table.error, table.narrow).seen_from(*entry_of(colon)))
    return found


def together(tables: Sequence[Sequence[Tables]]) -> Tables:
    """Tables of several patients as one, whose mesenteries come once for each thing that an assistant may do."""
    base = stack([each[0] for each in tables])
    hung: list[Any] = [each[asked].mesentery for asked in range(len(ASSISTANT)) for each in tables]
    return base._replace(mesentery=mesentery.stack(hung))


LINEAR = Backend(start=partial(_start, device="cpu"), batch=_JOBS, alike="conditions", prepare=_prepare)
"""A process a core, each with patients of its own: none waits for another's slowest, nor for one line of Python."""
LINEAR_GPU = Backend(start=partial(_start, device="cuda"), batch=4096, most_workers=1, prepare=_prepare_gpu)
"""One process: it fills the device by itself."""
