"""The backend 'linear': random settings, shocks, numbers that are none, ten million steps, runs that repeat."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.store import load_colon
from haustra.models.devices.scope.cable import PULL_OUT_LIMIT
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import build_scene
from haustra.scripts.bench.result import Criterion, Table, Value
from haustra.scripts.bench.stability.linear_runs import WORLDS, begin, both_ways, largest_travel
from haustra.scripts.bench.stability.long import CYCLE, GROWTH, growth, memory
from haustra.scripts.bench.stability.moving_rig import OPTIONS, MovingRig, all_finite
from haustra.scripts.bench.stability.nan_injection import WORLDS as INJECTED_WORLDS
from haustra.scripts.bench.stability.nan_injection import Injection, batch_cases, small_bank
from haustra.scripts.bench.stability.nan_injection import judge as judge_cases
from haustra.scripts.bench.stability.part import Part, Progress, RunOptions
from haustra.scripts.bench.stability.random_runs import HOLD, PRESETS_TWICE, prepare_colons
from haustra.scripts.bench.stability.rows import Row, Rows, fill

SETTINGS, QUICK_SETTINGS = 1000, 16
SECONDS, QUICK_SECONDS = 10.0, 2.0
"""Simulated in each random run [s]."""
COLONS, QUICK_COLONS = 4, 1
LONG_WORLDS = 128
LONG_STEPS, QUICK_LONG_STEPS = 80_000, 8_000
"""Time steps of each of them: in fixed colons, and again in colons that move."""
STEERED = 1 / 3
"""Share of pulls or travel that hands of long runs use, as those of the other backends: 20 N of 60 N."""
RECORDS = 50
"""Looks at memory and state."""
REPEATED = 400
"""Time steps of runs that are repeated."""
DRIVE_IN = 6.0
"""Time in which scopes are pushed in before a shock [s]."""


def linear(order: RunOptions, progress: Progress) -> Part:
    """All of it."""
    count = QUICK_SETTINGS if order.quick else SETTINGS
    seconds = QUICK_SECONDS if order.quick else SECONDS
    colons = QUICK_COLONS if order.quick else COLONS
    folder = order.folder / "colons"
    prepare_colons(folder, colons, lambda seed: progress(0.0, f"growing colon {seed}"), walls=False)
    setting = {"seed": order.seed, "count": count, "seconds": seconds, "colons": colons}
    rows = Rows(order.folder / "linear.jsonl", setting)
    given = (str(folder), order.seed, count, seconds, colons)

    def half(done: float, note: str) -> None:
        progress(0.5 * done, note)

    fill(rows, count, begin, given, workers=order.workers, deadline=order.deadline, progress=half)
    colon = load_colon(folder / "grown-0")
    shocked, driven = [], []
    for part, moves in enumerate((False, True)):
        shocked += [row for wheels in (False, True) for row in shocks(colon, moves=moves, wheels=wheels)]
        progress(0.55 + 0.2 * part, "long run")
        steps = QUICK_LONG_STEPS if order.quick else LONG_STEPS
        driven.append(long_run(colon, steps, moves=moves, threads=order.workers))
    progress(0.95, "numbers that are none, repeats")
    found = rows.first(count)
    planned = 2 * LONG_WORLDS * (QUICK_LONG_STEPS if order.quick else LONG_STEPS)
    part = judge(found, shocked, driven, repeats(colon), inject(colon), steps=planned)
    return replace(part, counts={"settings": len(found)}, planned={"settings": count})


def _backend(colon: Colon, worlds: int, *, moves: bool, **own: Any) -> LinearBackend:
    """Adult scopes at the anus, in one colon."""
    rig, options = MovingRig(colon, 1), replace(OPTIONS, mesentery=moves)
    scene = build_scene(colon, None, named_design("adult"), options, show_lumen=False)
    backend = LinearBackend(scene, rig.tables() if moves else rig.fixed(), worlds=worlds, **own)
    one = np.ones(worlds)
    friction = np.linspace(0.03, 0.2, worlds)
    backend.reset(np.arange(worlds), np.zeros(worlds, int), Conditions(friction, OPTIONS.wall_stiffness * one, one))
    return backend


def _hands(worlds: int, seed: int, start: float, *, wheels: bool) -> Callable[[LinearBackend], Controls]:
    """In and out again every `CYCLE`, each world at a phase of its own; rolled, and steered by pulls or wheels."""
    rng, phases = np.random.default_rng(seed), CYCLE * np.arange(worlds) / worlds
    design = named_design("adult")

    def next_hands(backend: LinearBackend) -> Controls:
        seen = backend.state()
        outwards = (seen.time + phases) % CYCLE > CYCLE / 2
        # Out a little slower than in, and never before the start.
        rate = np.where(outwards, np.where(seen.qpos[:, 0] > start, -0.06, 0.0), 0.06)
        sides = STEERED * rng.uniform(-1.0, 1.0, (worlds, 2))
        turned = largest_travel(design) * sides if wheels else None
        return Controls(rate, rng.uniform(-1.0, 1.0, worlds), design.wires.pull_limit * both_ways(sides), turned)

    return next_hands


def long_run(colon: Colon, steps: int, *, moves: bool, threads: int) -> dict[str, Value]:
    """Pushed in and pulled out again and again, steered by wheels; state and memory looked at now and then."""
    backend = _backend(colon, LONG_WORLDS, moves=moves, threads=threads)
    hands, count = _hands(LONG_WORLDS, 0, 0.0, wheels=True), round(HOLD / OPTIONS.timestep)
    records: list[dict[str, Any]] = []
    done, began, fastest, finite = 0, time.perf_counter(), 0.0, True
    while done < steps:
        alive = backend.step(hands(backend), count)
        done += count
        if done % max(count, steps // RECORDS // count * count) == 0 or not alive.all():
            fastest = max(fastest, float(np.abs(backend.state().qvel).max()))
            finite &= all_finite(backend)
            records.append({"steps": done * LONG_WORLDS, "memory_MiB": memory()})
        if not alive.all():
            break
    row: dict[str, Value] = {"colon": "on its mesentery" if moves else "fixed", "worlds": LONG_WORLDS}
    row |= {"world_steps": done * LONG_WORLDS, "simulated_s": done * OPTIONS.timestep}
    row |= {"lost": int((~backend.alive).sum()), "finite": finite, "fastest_per_s": fastest}
    row |= {"memory_last_MiB": records[-1]["memory_MiB"], "growth_MiB_per_million": growth(records)}
    backend.close()
    return row | {"wall_clock_s": time.perf_counter() - began}


def repeats(colon: Colon) -> int:
    """Numbers of the state that differ in their bits from those of the same run before, whatever the threads."""
    differ = 0
    for moves in (False, True):
        ends = []
        for threads in (1, 1, 2):
            backend, count = _backend(colon, 24, moves=moves, threads=threads), round(HOLD / OPTIONS.timestep)
            hands = _hands(24, 1, 0.0, wheels=True)
            for _ in range(REPEATED // count):
                backend.step(hands(backend), count)
            state = backend.state()
            axis = state.displacement or ()
            ends.append(np.concatenate([np.ravel(part) for part in (*state[:5], state.pulls, *axis)]))
            backend.close()
        differ += sum(int((end != ends[0]).sum()) for end in ends[1:])
    return differ


_SOFT = "wall stiffness over 100, back"
SHOCKS = (
    "none",
    "friction 0, 1, back",
    "wall stiffness times 100, back",
    _SOFT,
    "gravity turned six ways",
    "tip thrown from side to side",
    "tip released from full bend",
    "pulled out at 1 m/s",
)
"""One a world; what is done to it while the hands of all push on."""


def shocks(colon: Colon, *, moves: bool, wheels: bool) -> list[dict[str, Value]]:
    """Each shock to a world of its own, steered by pulls or by wheels; a row each."""
    worlds, design = len(SHOCKS), named_design("adult")
    backend, one = _backend(colon, worlds, moves=moves, real=np.float64), np.ones(len(SHOCKS))
    most = largest_travel(design) if wheels else design.wires.pull_limit
    speeds: list[np.ndarray] = []

    def on(name: str) -> np.ndarray:
        return np.array([each == name for each in SHOCKS])

    def steer(sides: np.ndarray) -> dict[str, Any]:
        return {"pulls": most * both_ways(sides), "wheels": most * sides if wheels else None}

    def go(seconds: float, push: np.ndarray, sides: np.ndarray) -> None:
        for _ in range(round(seconds / 0.02)):
            backend.step(Controls(push, 0 * one, **steer(sides)), 4)
            speeds.append(np.abs(backend.state().qvel).max(axis=1))

    push, bent = 0.05 * one, np.tile([0.35, 0.15], (worlds, 1))
    thrown, let_go = on("tip thrown from side to side")[:, None], on("tip released from full bend")[:, None]
    go(DRIVE_IN, push, bent)
    go(1.0, push, np.where(thrown | let_go, [1.0, 0.0], bent))
    wall = np.where(on("wall stiffness times 100, back"), 100.0, 1.0) * np.where(on(_SOFT), 0.01, 1.0)
    for stage, slip in enumerate((0.0, 1.0)):
        backend.give("friction", np.where(on("friction 0, 1, back"), slip, OPTIONS.friction))
        backend.give("stiffness", OPTIONS.wall_stiffness * (one if stage else wall))
        for turn in range(5):
            down = np.zeros((worlds, 3))
            down[on("gravity turned six ways"), (turn + stage) % 3] = 9.81 * (-1) ** turn
            backend.load(down)
            out = np.where(on("pulled out at 1 m/s"), -PULL_OUT_LIMIT, push) if turn + stage == 0 else push
            go(0.2, out, np.where(thrown, [(-1.0) ** (turn + 1), 0.0], np.where(let_go, 0.0, bent)))
    backend.give("friction", OPTIONS.friction)
    backend.load(np.zeros((worlds, 3)))
    go(4.0, 0 * one, 0 * bent)
    finite, alive = all_finite(backend), backend.alive
    backend.close()
    fastest, last = np.max(speeds, axis=0), np.max(speeds[-50:], axis=0)
    where = {"colon": "on its mesentery" if moves else "fixed", "steered_by": "wheels" if wheels else "pulls"}
    return [
        where
        | {"shock": name, "outcome": "finished" if alive[world] else "diverged", "finite": finite}
        | {"fastest_per_s": float(fastest[world]), "speed_last_second_per_s": float(last[world])}
        for world, name in enumerate(SHOCKS)
    ]


def inject(colon: Colon) -> list[Injection]:
    """NaN and infinities in what hands do, wheels too, and in what worlds begin with."""
    bank = small_bank(colon)
    make = partial(LinearBackend, bank.scene, bank.tables, worlds=INJECTED_WORLDS)
    return [*batch_cases("linear batch", make), *batch_cases("linear batch, wheels", make, wheels=True)]


def judge(
    rows: list[Row],
    shocked: list[dict[str, Value]],
    driven: list[dict[str, Value]],
    differ: int,
    cases: list[Injection],
    *,
    steps: int,
) -> Part:
    """Bars and tables; of long runs so many steps were planned."""
    where, bad = "in linear time", ("diverged", "crashed")

    def none(what: str, measured: float, unit: str) -> Criterion:
        return Criterion(f"{what}, {where}", measured, 0, unit, "at most")

    longer = [row for row in rows if row.get("timestep_s", 0.0) > PRESETS_TWICE]
    usual, injected = [row for row in rows if row not in longer], judge_cases(cases)
    grown = max(float(row["growth_MiB_per_million"] or 0.0) for row in driven)
    taken, lost = (sum(int(row[name] or 0) for row in driven) for name in ("world_steps", "lost"))
    criteria = (
        none(f"settings that diverged at steps up to {1e3 * PRESETS_TWICE:g} ms", _count(usual, *bad), "runs"),
        none("settings that diverged at longer steps", _count(longer, *bad), "runs"),
        none("settings refused", _count(rows, "refused"), "runs"),
        none("settings that left something not finite to read", _unsound(rows), "runs"),
        none("shocks after which a scope diverged", _count(shocked, "diverged"), "shocks"),
        Criterion(f"steps of long runs, {where}", taken, steps, "steps", "at least"),
        none("worlds of long runs that diverged", lost, "worlds"),
        Criterion(f"growth of memory per million steps, {where}", grown, GROWTH, "MiB", "at most"),
        none("numbers of the state that differ when a run is repeated", differ, "numbers"),
        *(none(criterion.what, criterion.measured, criterion.unit) for criterion in injected.criteria),
    )
    tables = (
        _settings(rows),
        Table("Shocks in linear time", tuple(shocked)),
        Table("Long runs in linear time", tuple(driven)),
        replace(injected.tables[0], title="NaN and Inf in inputs in linear time"),
    )
    return Part(criteria, tables, summary=_SUMMARY)


def _count(rows: list[Any], *outcomes: str) -> int:
    return sum(row["outcome"] in outcomes for row in rows)


def _unsound(rows: list[Row]) -> int:
    return sum(not row.get("finite", True) for row in rows)


def _settings(rows: list[Row]) -> Table:
    """One row a kind of colon, steering and precision."""
    ran, table = [row for row in rows if "world_steps" in row], []
    for moves, wheels, real in sorted({(row["moves"], row["wheels"], row["real"]) for row in ran}):
        own = [row for row in ran if (row["moves"], row["wheels"], row["real"]) == (moves, wheels, real)]
        table.append(
            {
                "colon": "on its mesentery" if moves else "fixed",
                "steered_by": "wheels" if wheels else "pulls",
                "precision": real,
                "settings": len(own),
                "diverged": _count(own, "diverged"),
                "worlds": len(own) * WORLDS,
                "world_steps": sum(row["world_steps"] for row in own),
                "fastest_per_s": max(row["fastest"] for row in own),
                "pressing_mean": float(np.mean([row["pressing"] for row in own])),
            }
        )
    return Table("Random settings in linear time", tuple(table))


_SUMMARY = (
    f"Linear time: random scopes, scenes, wires, hands inside the ranges by Sobol's sequence, {WORLDS} worlds of each "
    "setting, which differ in hands, wall and mesentery; half in colons that are fixed, half on mesenteries of random "
    "numbers, half of each steered by wheels, half in single precision. Hands change what they do every 0.4 s. Shocks "
    f"and long runs are of an adult scope in grown colon 0; long ones are pushed in and pulled out every {CYCLE:g} s."
)
