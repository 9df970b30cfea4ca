"""Ten million steps: is everything finite to the end, and does memory stay flat?"""

import resource
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.anatomy.store import load_colon
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.wall.pieces.folder import wall_of
from haustra.scripts.bench.result import Criterion, Table
from haustra.scripts.bench.stability.part import Part, Progress, RunOptions
from haustra.scripts.bench.stability.random_runs import divergence, prepare_colons
from haustra.scripts.bench.stability.rows import Answer, Row, Rows, fill

STEPS, QUICK_STEPS = 10_000_000, 100_000
"""Number of steps of all runs together."""
RUNS, QUICK_RUNS = 10, 1
"""They run at once, each with hands of its own: a million steps are more than an hour of simulated time."""
RECORDS = 100
"""Looks at memory and state."""
CYCLE = 8.0
"""In and out again [s]."""
GROWTH = 1.0
"""Memory may grow by this much per million steps, after the first tenth [MiB]: a page here and there."""


def long_run(order: RunOptions, progress: Progress) -> Part:
    """Pushed in and pulled out again and again, steered, in a wall of pieces; each run in a process of its own."""
    steps, runs = (QUICK_STEPS, QUICK_RUNS) if order.quick else (STEPS, RUNS)
    folder = order.folder / "colons"
    prepare_colons(folder, 1, lambda seed: progress(0.0, "growing colon 0"))
    rows = Rows(order.folder / "long.jsonl", {"steps": steps, "runs": runs})
    given = (str(folder / "grown-0"), steps // runs)
    # With one worker as well in a child: what this process has done before is not to count as memory of the run.
    fill(rows, runs, begin, given, workers=max(2, order.workers), deadline=order.deadline, progress=progress)
    return judge(rows.first(runs), steps)


def begin(folder: str, steps: int) -> Answer:
    """What answers rows in one process."""

    def answer(number: int) -> Row:
        records = list(run(Path(folder), steps, number))
        return {"number": number, "outcome": "" if records[-1]["healthy"] else "diverged", "records": records}

    return answer


def judge(rows: list[Row], planned: int) -> Part:
    """Bars and table of the finished runs."""
    ran = [row for row in rows if row["outcome"] != "crashed"]
    ends = [row["records"][-1] for row in ran]
    done = sum(end["steps"] for end in ends)
    finite = sum(end["steps"] for end in ends if end["healthy"])
    slopes = [growth(row["records"]) for row in ran]
    criteria = (
        Criterion("steps of runs that stayed finite", finite, planned, "steps", "at least"),
        Criterion(
            "long runs that diverged or crashed", sum(bool(row["outcome"]) for row in rows), 0, "runs", "at most"
        ),
        Criterion("growth of memory per million steps", max(slopes, default=np.inf), GROWTH, "MiB", "at most"),
    )
    table = tuple(
        {
            "run": row["number"],
            "steps": end["steps"],
            "simulated_s": end["time_s"],
            "named": end["named"],
            "memory_first_MiB": row["records"][0]["memory_MiB"],
            "memory_last_MiB": end["memory_MiB"],
            "growth_MiB_per_million": slope,
            "wall_clock_s": end["seconds"],
        }
        for row, end, slope in zip(ran, ends, slopes, strict=True)
    )
    return Part(
        criteria, (Table("Long runs", table),), summary=_SUMMARY, counts={"steps": done}, planned={"steps": planned}
    )


def growth(records: list[dict[str, Any]]) -> float:
    """Slope of memory over steps, after the first tenth [MiB per million steps]."""
    kept = [each for each in records if each["steps"] > records[-1]["steps"] / 10] if len(records) > 2 else records
    count, memory = (np.array([each[name] for each in kept], float) for name in ("steps", "memory_MiB"))
    return float(np.polyfit(count / 1e6, memory, 1)[0]) if len(kept) > 1 else np.inf


def run(colon_folder: Path, steps: int, seed: int) -> Iterator[dict[str, Any]]:
    """Step, and tell state and memory now and then; ends early when the run diverges."""
    colon = load_colon(colon_folder)
    wall = wall_of(colon_folder, colon, "prism")
    options = SceneOptions()
    engine = NativeEngine(build_scene(colon, wall, named_design("adult"), options, show_lumen=False))
    rng = np.random.default_rng(seed)
    block, done, began = 4, 0, time.perf_counter()
    every = max(block, steps // RECORDS)
    pulls = np.zeros(4)
    while done < steps:
        phase = engine.data.time % CYCLE
        if phase < block * options.timestep:
            sides = rng.uniform(-20.0, 20.0, 2)
            pulls = np.concatenate([np.maximum(sides, 0.0), np.maximum(-sides, 0.0)])
        # Out a little slower than in, and never before the start.
        rate = 0.06 if phase < CYCLE / 2 else -0.06 if engine.insertion > options.start_depth else 0.0
        healthy = engine.step(Controls(rate, 0.3 * np.sin(engine.data.time), pulls), block)
        done += block
        if done % every < block or not healthy:
            yield {
                "steps": done,
                "time_s": engine.data.time,
                "memory_MiB": memory(),
                "insertion_m": engine.insertion if healthy else None,
                "healthy": healthy,
                "named": "" if healthy else divergence(engine),
                "seconds": time.perf_counter() - began,
            }
        if not healthy:
            return


def memory() -> float:
    """In use now [MiB]; the most that was in use where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return pages * resource.getpagesize() / 2**20
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


_SUMMARY = (
    "An adult scope is pushed into grown colon 0 (prisms) and pulled out again every 8 s, rolled and steered; ten runs "
    "of a million steps, each in a process of its own and with its own hands (one of 100,000 in a quick run)."
)
