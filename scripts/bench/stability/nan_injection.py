"""A number that is none, in each input of one of many worlds: is it caught in a block, and do the others not notice?"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from haustra.envs.sim.backend import AbstractBackend
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.native_batch import NativeBackend
from haustra.envs.sim.state import Controls, Readings
from haustra.envs.tasks.bank import TASK_OPTIONS, ColonSet, make_bank
from haustra.envs.tasks.case import case_of
from haustra.envs.tasks.vector import NavigationVectorEnv
from haustra.errors import HaustraError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.scripts.bench.result import Criterion, Table
from haustra.scripts.bench.stability.part import Part, Progress, RunOptions
from haustra.scripts.bench.stability.ranges import build_setting, ranges

BAD = (np.nan, np.inf, -np.inf)
WORLDS, POISONED = 3, 1
BLOCK = 4
"""Time steps of a block."""
BLOCKS = 6
"""Looked at after the injection."""
WARM_UP = 20
"""Blocks before it."""


@dataclass(frozen=True)
class Injection:
    """One injection."""

    backend: str
    array: str
    value: float
    caught: str
    """`refused`, `diverged`, or empty when nothing told."""
    neighbours_same: bool
    finite: bool
    """Whether all that could be read of all worlds stayed finite."""

    @property
    def sound(self) -> bool:
        """Whether it was caught and did no harm."""
        return bool(self.caught) and self.neighbours_same and self.finite


def inject(order: RunOptions, progress: Progress) -> Part:
    """Every input of every backend, with every bad number; linear time has a part of its own."""
    bank = small_bank(grow_colon(seed=0))
    parts: list[Callable[[], list[Injection]]] = [
        lambda: single_cases(bank),
        lambda: batch_cases("native batch", lambda: NativeBackend(bank.scene, bank.tables, worlds=WORLDS)),
        lambda: batch_cases(
            "native batch, two threads", lambda: NativeBackend(bank.scene, bank.tables, worlds=WORLDS, threads=2)
        ),
        lambda: vector_cases(bank),
        design_cases,
    ]
    found: list[Injection] = []
    for number, part in enumerate(parts):
        found += part()
        progress((number + 1) / len(parts), found[-1].backend)
    return judge(found)


def small_bank(colon: Colon) -> ColonSet:
    """One colon and a short scope, since what is asked does not depend on their size."""
    design = named_design("paediatric")
    case = case_of(colon, device_radius=design.diameter / 2)
    return make_bank([case], design, replace(TASK_OPTIONS, insertion_limit=0.3))


def batch_cases(name: str, make: Callable[[], AbstractBackend], *, wheels: bool = False) -> list[Injection]:
    """Bad numbers in inputs while worlds run, and in the conditions that one begins anew with."""
    usual = _inputs(wheels=wheels)
    clean = _run(make(), usual, None, None)
    found = []
    for array in ("push_rate", "roll_rate", "wheels" if wheels else "pulls"):
        for value in BAD:
            found.append(_compare(name, array, value, clean, lambda a=array, v=value: _run(make(), usual, a, v)))
    clean = _restart(make(), usual, None, None)
    for array in ("friction", "wall_stiffness", "shaft_stiffness", "roll"):
        for value in BAD:
            found.append(_compare(name, array, value, clean, lambda a=array, v=value: _restart(make(), usual, a, v)))
    return found


Watched: TypeAlias = list[tuple[np.ndarray, Readings]]
"""Which worlds were healthy after each block, and what was seen."""


def _compare(backend: str, array: str, value: float, clean: Watched, run: Callable[[], Watched]) -> Injection:
    try:
        seen = run()
    except HaustraError:
        return Injection(backend, array, value, "refused", neighbours_same=True, finite=True)
    others = np.arange(WORLDS) != POISONED
    same = all(
        np.array_equal(values[others], getattr(before, name)[others])
        for (_, after), (_, before) in zip(seen, clean, strict=True)
        for name, values in after._asdict().items()
        if values is not None
    )
    healthy = all(row[others].all() for row, _ in seen)
    finite = all(np.isfinite(values).all() for _, after in seen for values in after if values is not None)
    caught = "" if seen[0][0][POISONED] else "diverged"
    return Injection(backend, array, value, caught, neighbours_same=same and healthy, finite=finite)


def _run(batch: AbstractBackend, inputs: Controls, array: str | None, value: float | None) -> Watched:
    every = np.arange(WORLDS)
    batch.reset(every, np.zeros(WORLDS, int), _conditions(WORLDS))
    for _ in range(WARM_UP):
        batch.step(inputs, BLOCK)
    if array:
        bad = getattr(inputs, array).copy()
        bad[POISONED] = value
        inputs = inputs._replace(**{array: bad})
    return _watch(batch, inputs)


def _restart(batch: AbstractBackend, inputs: Controls, array: str | None, value: float | None) -> Watched:
    every = np.arange(WORLDS)
    batch.reset(every, np.zeros(WORLDS, int), _conditions(WORLDS))
    for _ in range(WARM_UP):
        batch.step(inputs, BLOCK)
    begun = _conditions(1)
    if array:
        begun = replace(begun, **{array: np.array([value])})
    batch.reset(np.array([POISONED]), np.zeros(1, int), begun)
    return _watch(batch, inputs)


def _watch(batch: AbstractBackend, inputs: Controls) -> Watched:
    seen = [(np.array(batch.step(inputs, BLOCK)), batch.read()) for _ in range(BLOCKS)]
    batch.close()
    return seen


def _inputs(*, wheels: bool) -> Controls:
    pulls = np.tile([8.0, 0.0, 0.0, 3.0], (WORLDS, 1))
    turned = np.tile([0.003, -0.001], (WORLDS, 1)) if wheels else None
    return Controls(np.array([0.05, 0.06, 0.04]), np.array([0.0, 0.3, -0.3]), pulls, turned)


def _conditions(worlds: int) -> Conditions:
    one = np.ones(worlds)
    return Conditions(0.1 * one, 1500.0 * one, one.copy(), 0 * one)


def single_cases(bank: ColonSet) -> list[Injection]:
    """One scope on its own: there are no neighbours, but a run must not go on as if nothing had been."""
    options = SceneOptions(wall_law="planes", insertion_limit=0.3)
    found = []
    for array in ("push_rate", "roll_rate", "pulls", "wheels"):
        for value in BAD:
            backend = NativeEngine(build_scene(bank.cases[0].colon(), None, bank.design, options, show_lumen=False))
            scalar = array.endswith("rate")
            good = Controls(0.05, 0.0)
            backend.step(good, BLOCK)
            bad = value if scalar else np.full(2 if array == "wheels" else 4, value)
            try:
                caught = "" if backend.step(good._replace(**{array: bad}), BLOCK) else "diverged"
            except HaustraError:
                caught = "refused"
            found.append(Injection("native", array, value, caught, neighbours_same=True, finite=True))
    return found


def vector_cases(bank: ColonSet) -> list[Injection]:
    """Actions of a vector environment."""
    found = []
    for column, name in enumerate(("push", "roll", "tip up", "tip left")):
        for value in BAD:
            clean, bad = (_episode(bank, column, v) for v in (None, value))
            others = np.arange(WORLDS) != POISONED
            same = all(np.array_equal(a[others], b[others]) for a, b in zip(bad[0], clean[0], strict=True))
            finite = all(np.isfinite(a).all() for a in bad[0])
            caught = "diverged" if bad[1][POISONED] else ""
            found.append(Injection("vector environment", f"action: {name}", value, caught, same, finite))
    return found


def _episode(bank: ColonSet, column: int, value: float | None) -> tuple[list[np.ndarray], np.ndarray]:
    """What was seen, and which worlds had ended as diverged after one action with NaN or Inf."""
    made = NavigationVectorEnv(WORLDS, bank=bank, observation="state", autoreset_mode="NextStep")
    made.reset(seed=1)
    action = np.tile([0.5, 0.1, 0.3, -0.2], (WORLDS, 1)).astype(np.float32)
    for _ in range(5):
        made.step(action)
    bad = action.copy()
    if value is not None:
        bad[POISONED, column] = value
    seen, reward, *_, info = made.step(bad)
    later = made.step(action)
    made.close()
    return [seen, reward, later[0], later[1]], info["diverged"]


def design_cases() -> list[Injection]:
    """Numbers of scopes and scenes, as a sweep's worker is given them: refused before anything is built."""
    middle = {variable.path: variable.at(0.5) for variable in ranges()}
    turn = np.array([0.6, 0.48, 0.64])
    found = []
    for path in (path for path in middle if not path.startswith("input.") or path == "input.gravity"):
        for value in BAD:
            try:
                build_setting({**middle, path: value}, wall_law="planes", turn=turn)
                caught = ""
            except HaustraError:
                caught = "refused"
            found.append(Injection("sweep", path, value, caught, neighbours_same=True, finite=True))
    return found


def judge(found: list[Injection]) -> Part:
    """Bars and table; one row an array, with the bad numbers that were not caught."""
    criteria = (
        Criterion(
            "injections that were not caught within a block", sum(not c.caught for c in found), 0, "cases", "at most"
        ),
        Criterion(
            "injections that changed a neighbour", sum(not c.neighbours_same for c in found), 0, "cases", "at most"
        ),
        Criterion(
            "injections that left something not finite to read", sum(not c.finite for c in found), 0, "cases", "at most"
        ),
    )
    arrays = dict.fromkeys((case.backend, case.array) for case in found)
    rows = []
    for backend, array in arrays:
        cases = [case for case in found if (case.backend, case.array) == (backend, array)]
        rows.append(
            {
                "backend": backend,
                "array": array,
                "injected": ", ".join(str(case.value) for case in cases),
                "caught": ", ".join(dict.fromkeys(case.caught or "not caught" for case in cases)),
                "neighbours_same": all(case.neighbours_same for case in cases),
                "finite": all(case.finite for case in cases),
            }
        )
    text = (
        f"NaN and both infinities in world {POISONED} of {WORLDS}, in each input of each backend, {BLOCK} time steps a "
        "block; the other worlds are compared bit by bit with a run without. Sweeps get them as values of a design or "
        "scene and must refuse them by name."
    )
    return Part(
        criteria, (Table("NaN and Inf in inputs", tuple(rows)),), summary=text, counts={"injections": len(found)}
    )
