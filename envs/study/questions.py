"""The questions that a study may ask, and the backends that answer them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TypeAlias

from haustra.envs.study.store import Alike
from haustra.envs.study.study import Column, Job, Result, ScoreError, Study, Value
from haustra.errors import HaustraError, InvalidOptionError, InvalidStudyError, MissingDependencyError

Runner: TypeAlias = Callable[[Sequence[Job]], Iterable[Result]]
"""Answers some jobs at once, each exactly once, in any order and as soon as each is known."""


@dataclass(frozen=True)
class Backend:
    """A way to answer a question."""

    start: Callable[[Study, Path], Runner]
    """Called once in each process that computes: the study, and the folder for what jobs share."""
    batch: int = 1
    """Jobs that one call of the runner likes best."""
    alike: Alike = "nothing"
    """What jobs of one call need to have in common: it gains nothing by jobs that differ in it."""
    together: bool = False
    """Whether answers of one call come all at once, not each as it is known."""
    most_workers: int | None = None
    """More processes than this would be in each other's way."""
    prepare: Callable[[Study, Path, Callable[[str], None]], None] = lambda study, folder, tell: None
    """Called once before any job, to put what jobs share into the folder; tells what it does."""


@dataclass(frozen=True)
class Question:
    """What can be asked of a design."""

    scores: tuple[Column, ...]
    """What a finished job's row holds."""
    conditions: Mapping[str, Column]
    """What a design is tried under, by the name in a study's file."""
    options: type
    """A dataclass of declared fields with defaults: how it is simulated."""
    check: Callable[[Study, Mapping[str, float], Mapping[str, Value]], object]
    """Builds the design for values of the variables and conditions, without running it; raises when it is impossible
    or when a path or an option is not known."""
    may_lack: tuple[str, ...] = ()
    """Conditions that a study need not name."""
    errors: Callable[[Study, str], Mapping[str, ScoreError]] = lambda study, backend: {}
    """Largest numerical errors of scores that were measured for what a study asks of a backend."""


_QUESTIONS = {
    "propulsion": "haustra.envs.study.propulsion:QUESTION",
    "scope": "haustra.envs.study.scope:QUESTION",
    "device": "haustra.envs.study.device:QUESTION",
    "cohort": "haustra.envs.study.cohort:QUESTION",
    "compare": "haustra.envs.study.compare:QUESTION",
    "policy": "haustra.envs.study.policy:QUESTION",
}
_BACKENDS = {
    ("propulsion", "native"): "haustra.envs.study.propulsion:NATIVE",
    ("propulsion", "warp"): "haustra.envs.study.propulsion_worlds:WORLDS",
    ("scope", "native"): "haustra.envs.study.scope:NATIVE",
    ("scope", "linear"): "haustra.envs.study.scope_linear:LINEAR",
    ("scope", "linear-gpu"): "haustra.envs.study.scope_linear:LINEAR_GPU",
    ("device", "native"): "haustra.envs.study.device:NATIVE",
    ("device", "warp"): "haustra.envs.study.device:WARP",
    ("cohort", "linear"): "haustra.envs.study.cohort_batch:LINEAR",
    ("cohort", "linear-gpu"): "haustra.envs.study.cohort_batch:LINEAR_GPU",
    ("compare", "native"): "haustra.envs.study.compare:NATIVE",
    ("scope", "warp"): "haustra.envs.study.scope_warp:WARP",
    ("policy", "linear"): "haustra.envs.study.policy_training:LINEAR",
    ("policy", "linear-gpu"): "haustra.envs.study.policy_training:LINEAR_GPU",
}
"""Where a backend for a question is found; loaded when it is asked for."""

_EXTRAS = {"warp": "warp", "torch": "rl"}
"""Extras of what is missing: of a backend, or of a package."""

QUESTIONS = tuple(_QUESTIONS)


def find_question(name: str) -> Question:
    """The question of that name.

    Raises:
        InvalidStudyError: when there is none.
    """
    if name not in _QUESTIONS:
        raise InvalidStudyError(f"Question '{name}' is not known. Known: {', '.join(_QUESTIONS)}.")
    return _load(_QUESTIONS[name])


def find_backend(question: str, name: str) -> Backend:
    """The backend of that name for a question.

    Raises:
        InvalidOptionError: when it has none of that name.
        MissingDependencyError: when what it computes with is not installed.
    """
    known = [backend for asked, backend in _BACKENDS if asked == question]
    if name not in known:
        raise InvalidOptionError(f"Backend '{name}' does not answer '{question}'. Known: {', '.join(known)}.")
    try:
        return _load(_BACKENDS[question, name])
    except ModuleNotFoundError as error:
        extra = _EXTRAS.get(name) or _EXTRAS.get(error.name or "", "sweep")
        raise MissingDependencyError(
            f"The backend '{name}' needs {error.name}: pip install 'haustra[{extra}]'."
        ) from error


def one_by_one(answer: Callable[[Job], Result]) -> Runner:
    """A runner that answers one job after the other; one that cannot be answered fails with its reason."""

    def run(jobs: Sequence[Job]) -> Iterable[Result]:
        for job in jobs:
            yield _answered(answer, job)

    return run


def _answered(answer: Callable[[Job], Result], job: Job) -> Result:
    try:
        return answer(job)
    except MemoryError:
        raise
    except Exception as error:  # one design must not end the sweep, whatever is wrong with it
        return failure(job, error)


def failure(job: Job, error: Exception) -> Result:
    """Row of a job that could not be answered; what nobody foresaw is told by its type too."""
    line = " ".join(str(error).split())[:500]
    return Result(
        job.id, "failed", reason=line if isinstance(error, HaustraError) else f"{type(error).__name__}: {line}"
    )


def _load(place: str):
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)
