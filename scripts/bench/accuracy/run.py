"""Ask the questions one after another; finished ones are kept, so that a benchmark that was stopped goes on."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import mujoco

from haustra.envs.sim.log import log_to_stderr_only
from haustra.errors import InvalidOptionError
from haustra.files import write_json
from haustra.provenance import content_hash, package_versions
from haustra.scripts.bench.accuracy.question import Answer, Effort
from haustra.scripts.bench.machine import machine
from haustra.scripts.bench.result import Bench, bench_from_json

QUESTIONS: Mapping[str, str] = {
    "elastica": "a clamped rod against beam theory",
    "motion": "a swinging rod against a fine time step",
    "release": "a rod let go against published data",
    "wires": "the bending section's angle for a pull",
    "press": "a press on a soft wall against F = K d",
    "capstan": "a rope round a drum against the capstan equation",
    "buckling": "sinusoidal and helical buckling loads in a tube",
    "propulsion": "force and ripple of the tracked robot",
    "insertion": "a scripted insertion against a converged one",
    "field": "a table of the lumen in linear time against pieces in MuJoCo, in ten colons",
    "nodes": "a physics step against nodes, in a colon of 623,805 triangles",
    "growth": "cost against length, pieces, contacts and worlds",
    "plain": "balanced against the scene that a competent user would write",
}
"""Every question, by the name of its module, and what it asks."""

_CODE, _ROOMS = Path(__file__).parents[3], ("models", "envs/sim", "envs/runs/measure", "scripts/bench/reference")
"""Where models and backends stand; another state of them asks every question anew."""


def run_questions(
    names: Sequence[str],
    effort: Effort,
    *,
    folder: Path | None = None,
    progress: Callable[[int, str], None] = lambda done, note: None,
) -> Bench:
    """Ask questions and put their answers together.

    Args:
        names: of the questions; all when empty.
        effort: how much may be spent.
        folder: where finished answers are kept and looked for; none are when None.
        progress: told how many are done and what is going on.

    Raises:
        InvalidOptionError: when a question is not known.
    """
    chosen = chosen_questions(names)
    parts = []
    with silent_engine():
        for done, name in enumerate(chosen):
            progress(done, QUESTIONS[name])
            telling = replace(effort, tell=lambda note, done=done: progress(done, note))
            parts.append(_answered(name, telling, folder, _state(effort, name)))
    progress(len(chosen), "")
    return Bench(
        name="accuracy",
        title="Run time against error",
        summary=(_SUMMARY, *(line for part in parts for line in part.summary)),
        criteria=tuple(criterion for part in parts for criterion in part.criteria),
        fronts=tuple(front for part in parts for front in part.fronts),
        tables=tuple(table for part in parts for table in part.tables),
        machine={**machine(), "effort": "quick" if effort.quick else "full"},
    )


def chosen_questions(names: Sequence[str]) -> tuple[str, ...]:
    """Those names; all when there are none.

    Raises:
        InvalidOptionError: when a question is not known.
    """
    for name in names:
        if name not in QUESTIONS:
            raise InvalidOptionError(f"Question '{name}' is not known. Known: {', '.join(QUESTIONS)}.")
    return tuple(names) or tuple(QUESTIONS)


@contextmanager
def silent_engine() -> Iterator[None]:
    """MuJoCo says nothing: settings that diverge are what is looked for, and each is reported."""
    log_to_stderr_only()
    config = mujoco.MjLogConfig.get()
    before, config.logto_console = config.logto_console, False
    config.set()
    try:
        yield
    finally:
        config.logto_console = before
        config.set()


_SUMMARY = (
    "Each question turns one knob at a time around the defaults and measures the error against a reference. Costs are "
    "processor time, all settings of a front in turn, median of several turns."
)


def _answered(name: str, effort: Effort, folder: Path | None, state: str) -> Bench:
    """The kept answer, if code and effort are those of then, or a new one."""
    kept = folder / "questions" / f"{name}.json" if folder else None
    if kept and kept.is_file():
        try:
            found = json.loads(kept.read_text(encoding="utf-8"))
            if found["machine"].get("state") == state:
                return bench_from_json(found)
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            pass  # whatever it is, it is not an answer: ask again
    answer: Answer = import_module(f"haustra.scripts.bench.accuracy.{name}").answer(effort)
    part = Bench(
        name=f"accuracy/{name}",
        title=QUESTIONS[name],
        summary=tuple(answer.notes),
        criteria=tuple(answer.criteria),
        fronts=tuple(answer.fronts),
        tables=tuple(answer.tables),
        machine={"state": state},
    )
    if kept:
        kept.parent.mkdir(parents=True, exist_ok=True)
        write_json(kept, part.to_json())
    return part


def code_state() -> str:
    """A hash of versions and of the code that models and steps scenes, with that of the benchmarks of accuracy."""
    files = [path for room in _ROOMS for path in (_CODE / room).rglob("*.py")] + list(
        Path(__file__).parent.glob("*.py")
    )
    return content_hash(json.dumps(package_versions()).encode(), *(path.read_bytes() for path in sorted(files)))


def _state(effort: Effort, name: str) -> str:
    """A hash of the effort, of versions, and of the code that shapes an answer: other questions do not."""
    asked = [effort.quick, [str(path.resolve()) for path in effort.colons], str(effort.rods), package_versions()]
    here = Path(__file__).parent
    files = [path for room in _ROOMS for path in (_CODE / room).rglob("*.py")]
    files += [path for path in here.glob("*.py") if path.stem == name or path.stem not in QUESTIONS]
    return content_hash(json.dumps(asked).encode(), *(path.read_bytes() for path in sorted(files)))
