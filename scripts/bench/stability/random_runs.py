"""Random scopes in random colons under random inputs: does any diverge, and is each that does found and named?"""

from collections import Counter
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.sim.native import FATAL_WARNINGS, NativeEngine
from haustra.envs.sim.state import Controls
from haustra.errors import HaustraError
from haustra.models.anatomy.colon import Colon
from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import METADATA, load_colon, save_colon
from haustra.models.presets import PRESETS
from haustra.models.scene import build_scene
from haustra.models.wall.pieces.folder import wall_of
from haustra.models.wall.pieces.wall import Wall
from haustra.scripts.bench.result import Criterion, Table
from haustra.scripts.bench.stability.part import Part, Progress, RunOptions
from haustra.scripts.bench.stability.ranges import BEYOND, Range, Setting, build_setting, draw, ranges
from haustra.scripts.bench.stability.rows import Answer, Row, Rows, fill

RUNS, QUICK_RUNS = 1000, 16
"""Inside the ranges and again as many beyond them, together."""
SECONDS, QUICK_SECONDS = 10.0, 2.0
"""Simulated in each run [s]."""
COLONS, QUICK_COLONS = 4, 1
"""Grown colons that runs draw from."""
HOLD = 0.4
"""How long hands keep doing the same [s]."""
PRESETS_TWICE = 2 * min(preset.modelling["timestep"] for preset in PRESETS.values())
"""Twice the presets' own time step [s]: presets promise to run at half of what is stable, longer steps are the user's
risk, and told apart."""
PLAUSIBLE_SPEED = 100.0
"""A generalised speed that no scope has [m/s or rad/s]: 0.3 m/s of tip whip by a 5 mm radius are 60 rad/s. A run that
exceeds it without having diverged is counted apart."""


def random_runs(order: RunOptions, progress: Progress) -> Part:
    """Half of the runs inside the documented ranges, half up to a tenth beyond them."""
    count = QUICK_RUNS if order.quick else RUNS
    seconds = QUICK_SECONDS if order.quick else SECONDS
    colons = QUICK_COLONS if order.quick else COLONS
    prepare_colons(order.folder / "colons", colons, lambda done: progress(0.0, f"growing colon {done}"))
    setting = {"seed": order.seed, "count": count, "seconds": seconds, "colons": colons}
    rows = Rows(order.folder / "ranges.jsonl", setting)
    given = (str(order.folder / "colons"), order.seed, count, seconds, colons)
    fill(rows, count, begin, given, workers=order.workers, deadline=order.deadline, progress=progress)
    return judge(rows.first(count), seconds, count)


def prepare_colons(folder: Path, count: int, tell: Callable[[int], None], *, walls: bool = True) -> None:
    """Grow colons of seeds 0, 1, … with walls of prisms, unless they are there; `tell` is given each seed."""
    for seed in range(count):
        place = folder / f"grown-{seed}"
        tell(seed)
        if not (place / METADATA).is_file():
            save_colon(grow_colon(seed=seed), place)
        if walls:
            wall_of(place, load_colon(place), "prism")


def begin(folder: str, seed: int, count: int, seconds: float, colons: int) -> Answer:
    """What answers rows in one process."""
    variables = ranges()
    inside, outside = (draw(variables, (count + 1) // 2, seed=seed + half, beyond=half * BEYOND) for half in (0, 1))

    @lru_cache(maxsize=colons)
    def colon_and_wall(number: int) -> tuple[Colon, Wall]:
        place = Path(folder) / f"grown-{number}"
        colon = load_colon(place)
        return colon, wall_of(place, colon, "prism")

    def answer(number: int) -> Row:
        # Odd rows lie beyond; of each kind every second meets planes, every second pieces.
        values = (outside if number % 2 else inside)[number // 2]
        rng = np.random.default_rng([seed, number])
        law = ("planes", "pieces")[number // 2 % 2]
        colon_number = int(rng.integers(colons))
        turn = rng.standard_normal(3)
        row: Row = {"number": number, "beyond": bool(number % 2), "wall": law, "colon": colon_number, "values": values}
        try:
            setting = build_setting(values, wall_law=law, turn=turn / np.linalg.norm(turn))
            colon, wall = colon_and_wall(colon_number)
            return row | run_setting(setting, colon, wall if law == "pieces" else None, rng, seconds=seconds)
        except HaustraError as error:
            return row | {"outcome": "refused", "reason": str(error)}

    return answer


def run_setting(
    setting: Setting, colon: Colon, wall: Wall | None, rng: np.random.Generator, *, seconds: float
) -> dict[str, Any]:
    """One run under inputs that change at random; what became of it as JSON values."""
    engine = NativeEngine(build_scene(colon, wall, setting.design, setting.options, show_lumen=False))
    steps = max(1, round(0.02 / setting.options.timestep))
    until_change, fastest, outcome, reason = 0.0, 0.0, "finished", ""
    inputs = Controls(0.0, 0.0)
    while engine.data.time < seconds:
        if engine.data.time >= until_change:
            inputs, until_change = _hands(setting, rng), until_change + HOLD
        if not engine.step(inputs, steps):
            outcome, reason = "diverged", divergence(engine)
            break
        fastest = max(fastest, float(np.abs(engine.data.qvel).max()))
    quiet = unseen(engine) if outcome == "finished" else False
    return {
        "outcome": outcome,
        "reason": reason,
        "time_s": float(engine.data.time),
        "fastest": fastest,
        "insertion_m": engine.insertion if outcome == "finished" else None,
        "unseen": quiet,
    }


def _hands(setting: Setting, rng: np.random.Generator) -> Controls:
    """Mostly inwards, since that is where the wall is; two wires at most, as wheels would."""
    share = rng.uniform(-0.5, 1.0), rng.uniform(-1.0, 1.0)
    sides = rng.uniform(-1.0, 1.0, 2) * setting.pull * setting.design.wires.pull_limit
    pulls = np.concatenate([np.maximum(sides, 0.0), np.maximum(-sides, 0.0)])
    return Controls(setting.push_rate * share[0], setting.roll_rate * share[1], pulls)


def divergence(engine: NativeEngine) -> str:
    """What told that a run has diverged."""
    named = [str(kind).rsplit("WARN_")[-1] for kind in FATAL_WARNINGS if engine.data.warning[int(kind)].number]
    if named:
        return ", ".join(named)
    return "speed" if np.isfinite(engine.data.qvel).all() else "not finite"


def unseen(engine: NativeEngine) -> bool:
    """Whether a run that counts as sound holds anything that is not: divergence that went undetected."""
    data = engine.data
    seen = engine.read()
    numbers = (data.qpos, data.qvel, data.qacc, data.act, data.xpos, seen.tip, seen.link_forces)
    finite = all(np.isfinite(each).all() for each in numbers)
    resets = data.time < engine.model.opt.timestep
    return not finite or resets


def judge(rows: list[Row], seconds: float, planned: int) -> Part:
    """Bars and tables of the finished rows of the planned."""
    counted = {"runs inside the ranges": sum(not row.get("beyond", row["number"] % 2) for row in rows)}
    counted["runs beyond them"] = len(rows) - counted["runs inside the ranges"]
    wanted = {"runs inside the ranges": (planned + 1) // 2, "runs beyond them": planned // 2}
    inside = [row for row in rows if not row.get("beyond", row["number"] % 2)]
    bad = ("diverged", "crashed")
    unnamed = [row for row in rows if row["outcome"] == "diverged" and not row["reason"]]
    silent = [row for row in rows if row.get("unseen") or row["outcome"] == "crashed"]
    criteria = (
        *(Criterion(what, _count(some, *bad), 0, "runs", "at most") for what, some in _by_step(inside).items()),
        Criterion("runs refused inside the ranges", _count(inside, "refused"), 0, "runs", "at most"),
        Criterion("divergences without a name, inside or beyond", len(unnamed), 0, "runs", "at most"),
        Criterion("unsound runs that count as sound, or crash", len(silent), 0, "runs", "at most"),
    )
    kinds = Counter((row["beyond"], row["wall"], row["outcome"], row["reason"] or "") for row in rows if "wall" in row)
    table = Table(
        "Random runs",
        tuple(
            {"ranges": "beyond" if far else "inside", "wall": law, "outcome": outcome, "named": reason, "runs": count}
            for (far, law, outcome, reason), count in sorted(kinds.items())
        ),
        note=f"{seconds:g} s each",
    )
    fast = sorted((row for row in rows if row["outcome"] == "finished"), key=lambda row: -row["fastest"])[:5]
    fastest = Table(
        "Fastest runs that did not diverge",
        tuple(
            {
                "run": row["number"],
                "ranges": "beyond" if row["beyond"] else "inside",
                "wall": row["wall"],
                "fastest_per_s": row["fastest"],
                "timestep_s": row["values"]["scene.timestep"],
            }
            for row in fast
        ),
        note=f"Generalised speed, rad/s or m/s; above {PLAUSIBLE_SPEED:g} is no motion of a scope.",
    )
    return Part(criteria, (table, fastest, _table(ranges())), summary=_SUMMARY, counts=counted, planned=wanted)


def _by_step(inside: list[Row]) -> dict[str, list[Row]]:
    """Rows by how long their time step is; one whose child crashed tells no step and counts where it must not be."""
    what = f"runs that diverged inside the ranges, at steps up to {1e3 * PRESETS_TWICE:g} ms"
    found: dict[str, list[Row]] = {what: [], "the same, at longer steps": []}
    for row in inside:
        longer = row.get("values", {}).get("scene.timestep", 0.0) > PRESETS_TWICE
        found["the same, at longer steps" if longer else what].append(row)
    return found


def _count(rows: list[Row], *outcomes: str) -> int:
    return sum(row["outcome"] in outcomes for row in rows)


def _table(variables: tuple[Range, ...]) -> Table:
    return Table(
        "Ranges",
        tuple({"path": v.path, "low": v.low, "high": v.high, "unit": v.unit, "source": v.source} for v in variables),
    )


_SUMMARY = (
    "Random scopes in random grown colons, hands that change what they do every 0.4 s, all by Sobol's sequence: half "
    "of the runs inside the documented ranges, half in ranges widened by a tenth of their width at either end; half of "
    "each against tangent planes, half against pieces. A run ends when it diverges; nothing is averaged over runs."
)
