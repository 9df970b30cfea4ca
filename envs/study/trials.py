"""Published trials of colonoscopes with known answers, repeated in virtual patients: the same patients for both arms.

A trial is a file in assets/trials: what was published, two arms, an endpoint, and whether the arms were found different
or equal. Each arm is a study of a cohort (`haustra.envs.study.cohort`) in a store of its own, which trials share that
ask for the same arm, so that everything can be stopped and goes on. The effect is the mean difference, first arm less
second, over patients whom both arms examined and for whom both tell the endpoint (who never comes to the splenic
flexure has no loop there, nor none); its 95 % interval is a bootstrap over patients.

A difference is reproduced when the effect lies on the trial's side of zero, and resolved when its whole interval does.
An equality is reproduced when the effect lies within the trial's own 95 % interval, and resolved when its whole
interval does; the caecum must be reached in at least half of the insertions for either: two scopes that hardly ever
get there are equal for no good reason.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event
from typing import Any, Literal

import numpy as np

from haustra.assets import asset, assets
from haustra.children import cores
from haustra.envs.learning.statistics import mean_interval
from haustra.envs.study.run import Computing, run_sweep
from haustra.envs.study.store import read_store
from haustra.envs.study.study import Sampler, Study
from haustra.errors import HaustraError, InvalidOptionError, InvalidStudyError, UnsupportedSceneError
from haustra.fields import number, read_fields, span, texts
from haustra.provenance import file_hash
from haustra.reading import read_document

ARMS = "arms"
"""Folder of the arms' stores, by the hash of their studies."""
LEAST_PATIENTS = 3
"""An effect of fewer patients is not told; engineering choice."""
LEAST_REACHED = 0.5
"""Share of insertions that must reach the caecum for an equality to count [1]; engineering choice."""
RESAMPLES = 4000
"""Resamples of patients for intervals; engineering choice."""
_CORES = 2
"""Cores for each of the arms that are examined at the same time: two dozen patients fill no more."""
_CAECUM, _TIME, _DESCENDING_TIME = "caecum", "time_s", "descending_s"

Statistic = Literal["share of any", "mean", "restricted time", "restricted time from the descending colon"]
"""What is taken of a patient: 1 where any of the scores is, a score itself, the time to the caecum or the longest, or
that less the time to the middle of the descending colon."""


@dataclass(frozen=True)
class Endpoint:
    """What two arms are compared by."""

    meaning: str
    """What the number of a patient or of an arm is."""
    unit: str
    """Unit of the effect, '1' when dimensionless."""
    statistic: Statistic
    """What is taken of each patient."""
    scores: tuple = texts(most=10, default=())
    """Names of the scores of a cohort's study that it is made of; times need none."""


@dataclass(frozen=True)
class Arm:
    """Who is examined with what."""

    name: str
    """Name of the arm."""
    device: str
    """Shipped scope by its name, or a file beside the trial's."""
    stiffen_in: Literal["never", "descending", "transverse", "ascending"] = "never"
    """Segment from which on the stiffening ring is turned, once the shaft was straightened there."""
    gas_pressure: float | None = number("Pa", 500.0, 6000.0, default=None)
    """Pressure that colons are filled to at the start, and that gas is let in up to [Pa]. Both arms have the same
    colons, grown at the larger of their pressures: where there is less, they are narrower and draw together. When None,
    each is as wide as it was grown at its patient's own pressure."""
    water: float = number("m^3", 0.0, 2e-3, default=0.0)
    """Water in rectum and sigmoid at the start [m^3], with `gas_pressure` only."""


@dataclass(frozen=True)
class Trial:
    """A published trial and its answer."""

    title: str
    """What was compared."""
    source: str
    """Where it was published, and of how many patients."""
    published: str
    """Published outcome."""
    expected: Literal["different", "equal"]
    """What the trial found."""
    endpoint: Endpoint
    arms: tuple[Arm, ...]
    direction: Literal["less", "more"] | None = None
    """Whether the first arm had less or more than the second, where they are different."""
    interval: tuple[float, float] | None = span("1", -1.0, 1.0, default=None)
    """95 % interval of the trial's own effect, where the arms are equal."""
    sex: Literal["any", "female", "male"] = "any"
    """Who took part."""
    assumed: tuple = texts(most=20, default=())
    """What is assumed where the publication does not say."""


@dataclass(frozen=True)
class Answer:
    """A trial's simulated effect."""

    name: str
    trial: Trial
    patients: int
    """Patients for whom both arms tell the endpoint."""
    first: float | None
    """Mean of the first arm; None where there are too few patients."""
    second: float | None
    """Mean of the second arm."""
    effect: float | None
    low: float | None
    high: float | None
    reached: tuple[float, float] | None
    """Share of the patients in which each arm came to the caecum."""
    arrived: float | None
    """Effect over those patients whom both arms brought to the caecum; None where there are too few patients."""

    @property
    def reproduced(self) -> bool:
        """Whether the trial's answer is reproduced: the sign of a difference, or an equality."""
        return self.effect is not None and self._as_published(self.effect, self.effect)

    @property
    def resolved(self) -> bool:
        """Whether the whole 95 % interval says so too."""
        return self.low is not None and self.high is not None and self._as_published(self.low, self.high)

    def _as_published(self, low: float, high: float) -> bool:
        """Whether all effects between those are as the trial found."""
        if self.trial.expected == "different":
            return high < 0 if self.trial.direction == "less" else low > 0
        least, most = self.trial.interval or (0.0, 0.0)
        return least <= low and high <= most and self.reached is not None and sum(self.reached) >= 2 * LEAST_REACHED


def trial_names() -> tuple[str, ...]:
    """Names of the trials that ship."""
    return tuple(assets("trials", ".toml"))


def load_trial(name: str) -> tuple[Trial, Path]:
    """A shipped trial by its name, or one from a file that ends in .toml, and the file.

    Raises:
        UnreadableFileError: when the file is missing or not TOML.
        InvalidOptionError: when no trial has that name.
        InvalidStudyError: when a key is unknown or missing, or a value impossible; the message has its path.
    """
    known = trial_names()
    if not name.endswith(".toml") and name not in known:
        raise InvalidOptionError(f"Trial '{name}' is not known. Known: {', '.join(known)}; or name a .toml file.")
    path = Path(name) if name.endswith(".toml") else asset(f"trials/{name}.toml")
    found: Trial = read_fields(Trial, read_document(path, "trial"), path.name, error=InvalidStudyError)
    if len(found.arms) != 2:
        raise InvalidStudyError(f"{path.name}: arms: give two, not {len(found.arms)}.")
    if (found.direction is None) == (found.expected == "different"):
        raise InvalidStudyError(f"{path.name}: direction: give it where arms are different, and only there.")
    if (found.interval is None) == (found.expected == "equal"):
        raise InvalidStudyError(f"{path.name}: interval: give it where arms are equal, and only there.")
    needs = found.endpoint.statistic in ("share of any", "mean")
    if needs != bool(found.endpoint.scores):
        raise InvalidStudyError(f"{path.name}: endpoint.scores: a share or mean needs them, a time has none.")
    return found, path


def arm_study(
    trial: Trial, path: Path, arm: Arm, *, patients: int, driver: str, seconds: float, seed: int = 0
) -> Study:
    """The study of one arm: patients by a Latin hypercube, the same for both arms.

    Raises:
        InvalidStudyError: when the endpoint names a score that a cohort's study has not.
        InvalidDesignError: when the device is not known.
    """
    from haustra.envs.study.cohort import SCORES, CohortOptions, check
    from haustra.envs.study.patients import patient_variables

    known = [column.name for column in SCORES]
    for name in trial.endpoint.scores:
        if name not in known:
            raise InvalidStudyError(f"{path.name}: endpoint.scores: '{name}' is not known. Known: {', '.join(known)}.")
    changes: dict[str, float] = {}
    if trial.sex != "any":
        changes["patient.sex"] = 0.0 if trial.sex == "female" else 1.0
    if pressures := [one.gas_pressure for one in trial.arms if one.gas_pressure is not None]:
        changes["patient.gas_pressure"] = max(pressures)
    device, inputs = arm.device, {}
    if device.endswith(".toml"):
        device = str((path.parent / device).resolve())
        inputs = {device: file_hash(Path(device))}
    options: dict[str, Any] = {"seconds": seconds, "timestep": CohortOptions().timestep, "stiffen_in": arm.stiffen_in}
    if arm.gas_pressure is not None or arm.water:
        options |= {"gas": arm.gas_pressure, "water": arm.water}
    study = Study(
        question="cohort",
        title=arm.name,
        base="default",
        variables=tuple(variable for variable in patient_variables() if variable.path not in changes),
        conditions={"driver": (driver,), "device": (device,)},
        objectives=(),
        sampler=Sampler(kind="latin-hypercube", count=patients, seed=seed),
        changes=changes,
        options=options,
        inputs=inputs,
    )
    check(study, {}, {"driver": driver, "device": device})
    return study


def run_trials(
    names: Sequence[str],
    folder: Path,
    *,
    patients: int,
    driver: str,
    seconds: float,
    seed: int = 0,
    backend: str = "linear",
    progress: Callable[[int, int, str], None] = lambda done, total, note: None,
) -> list[Answer]:
    """Run what is missing of both arms of each trial, and tell their effects.

    Args:
        names: of shipped trials, or files.
        folder: for the arms' stores; what is there already is not run again.
        patients: of each arm.
        driver: who drives.
        seconds: longest insertion [s].
        seed: of the Latin hypercube that patients are drawn by.
        backend: what steps them: linear, or linear-gpu.
        progress: told how many arms are done, of how many, and a note.

    Raises:
        HaustraError: when a trial cannot be read or run.
    """
    trials = [(name, *load_trial(name)) for name in names]
    asked = {"patients": patients, "driver": driver, "seconds": seconds, "seed": seed}
    studies = {
        (name, arm.name): arm_study(trial, path, arm, **asked) for name, trial, path in trials for arm in trial.arms
    }
    for (name, _), study in studies.items():  # before the first runs, not when it is their turn
        if backend == "linear-gpu" and study.options.get("gas") is not None:
            raise UnsupportedSceneError(
                f"The backend 'linear-gpu' cannot honour the gas of the trial '{name}'; linear can: name other trials."
            )
    arms = {study.hash: study for study in studies.values()}
    abreast = 1 if backend == "linear-gpu" else max(min(len(arms), cores() // _CORES), 1)
    computing = Computing(backend=backend, workers=cores() // abreast)

    over = Event()

    def go_on(done: int, total: int, note: str) -> None:
        if over.is_set():
            raise HaustraError("Trials were ended: what was recorded is kept.")

    def examine(study: Study) -> None:
        own = {"resume": True, "tables": False, "progress": go_on}
        run_sweep(replace(study, title=study.hash), folder / ARMS / study.hash, computing, **own)

    progress(0, len(arms), "")
    with ThreadPoolExecutor(abreast) as pool:
        waiting = [pool.submit(examine, study) for study in arms.values()]
        try:
            for done, arm in enumerate(as_completed(waiting)):
                arm.result()
                progress(done + 1, len(arms), "")
        except BaseException:  # an interruption too: arms that run end at their next patient, others do not begin
            over.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [
        answered(name, trial, [_finished(folder, studies[name, arm.name]) for arm in trial.arms], seconds=seconds)
        for name, trial, _ in trials
    ]


def _finished(folder: Path, study: Study) -> dict[int, Mapping[str, Any]]:
    """Scores of an arm's patients who were examined to an end, by number."""
    from haustra.envs.study.cohort_table import by_patient

    with read_store(folder / ARMS / study.hash) as store:
        return by_patient(store)


def answered(name: str, trial: Trial, arms: Sequence[Mapping[int, Mapping[str, Any]]], *, seconds: float) -> Answer:
    """A trial's effect, from the scores of both arms by patient, and the longest insertion [s]."""
    told = [{patient: _of_patient(trial.endpoint, scores, seconds) for patient, scores in arm.items()} for arm in arms]
    both = [one for one in sorted(set(told[0]) & set(told[1])) if told[0][one] is not None and told[1][one] is not None]
    if len(both) < LEAST_PATIENTS:
        return Answer(name, trial, len(both), None, None, None, None, None, None, None)
    values = [np.array([each[patient] for patient in both], float) for each in told]
    examined = set(arms[0]) & set(arms[1])
    reached = [float(np.mean([arm[patient][_CAECUM] for patient in examined])) for arm in arms]
    low, high = mean_interval(values[0] - values[1], resamples=RESAMPLES)
    first, second = (float(each.mean()) for each in values)
    came = np.array([all(arm[patient][_CAECUM] for arm in arms) for patient in both])
    arrived = float((values[0] - values[1])[came].mean()) if came.sum() >= LEAST_PATIENTS else None
    return Answer(name, trial, len(both), first, second, first - second, low, high, (reached[0], reached[1]), arrived)


def _of_patient(endpoint: Endpoint, scores: Mapping[str, Any], seconds: float) -> float | None:
    """A patient's number; None where it cannot be told."""
    own = [scores[name] for name in endpoint.scores]
    if None in own:
        return None
    if endpoint.statistic == "mean":
        return float(np.mean(own))
    if endpoint.statistic == "share of any":
        return float(any(own))
    time = min(float(scores[_TIME]), seconds) if scores[_CAECUM] else seconds
    if endpoint.statistic == "restricted time":
        return time
    begun = scores[_DESCENDING_TIME]
    return None if begun is None or begun > seconds else time - float(begun)
