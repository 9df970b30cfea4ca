"""Devices side by side: the same patients for all, each device by the driver that comes with it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from haustra.envs.runs.outcome import Outcome
from haustra.envs.study.compare_passage import SITES, CompareOptions, pass_through
from haustra.envs.study.compare_patients import patient_named, patients
from haustra.envs.study.compare_pictures import draw
from haustra.envs.study.compare_table import summarise
from haustra.envs.study.questions import Backend, Question, Runner, one_by_one
from haustra.envs.study.store import read_store
from haustra.envs.study.study import Column, Job, Result, Sampler, Study, Value
from haustra.errors import InvalidOptionError
from haustra.models.devices.base import load_device

PICTURES = "pictures"
"""Folder of pictures and films within a comparison's: of each device in the first patient."""
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
    Column("mucosa_seen", "1", "share of the mucosa that the camera had near and in view on its way"),
    Column("work_J", "J", "work that hand, actuators or worm put in"),
    Column("begins_m", "m", "where along the colon its tip began"),
    Column("mesentery", "1", "1 where the colon was on its mesentery, 0 where it stood fixed"),
)
PAIN_BY_SITE = tuple(Column(f"pain_{site}", "1", f"largest pain at the {site.replace('_', ' ')}") for site in SITES)


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


def _start(study: Study, folder: Path) -> Runner:
    options = CompareOptions(**{name: float(value) for name, value in study.options.items()})
    first = str(study.conditions["patient"][0])

    def answer(job: Job) -> Result:
        device, patient = load_device(str(job.conditions["device"])), patient_named(str(job.conditions["patient"]))
        found = pass_through(device, patient, options)
        if found.scores["outcome"] == Outcome.DIVERGED.value:
            return Result(job.id, "diverged", reason=Outcome.DIVERGED.advice)
        if patient.name == first:
            draw(found.run, patient, folder / PICTURES / f"{device.name}.png")
        return Result(job.id, "finished", scores=found.scores, curves=found.curves)

    return one_by_one(answer)


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
