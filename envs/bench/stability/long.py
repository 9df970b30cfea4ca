"""Ten million steps: is everything finite to the end, and does memory stay flat?"""

import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from haustra.envs.bench.result import Bar, Table
from haustra.envs.bench.stability.part import Order, Part, Progress
from haustra.envs.bench.stability.random_runs import divergence, prepare_colons
from haustra.envs.engine.native import Inputs, NativeEngine
from haustra.errors import HaustraError
from haustra.models.anatomy.store import load_colon
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.scope.library import named_design
from haustra.models.wall.folder import wall_of

STEPS, QUICK_STEPS = 10_000_000, 100_000
RECORDS = 100
"""Looks at memory and state."""
CYCLE = 8.0
"""In and out again [s]."""
GROWTH = 1.0
"""Memory may grow by this much per million steps, after the first tenth [MiB]: a page here and there."""


def long_run(order: Order, progress: Progress) -> Part:
    """Pushed in and pulled out again and again, steered, in a wall of pieces; in a process of its own."""
    steps = QUICK_STEPS if order.quick else STEPS
    folder = order.folder / "colons"
    prepare_colons(folder, 1, lambda seed: progress(0.0, "growing colon 0"))
    child = subprocess.Popen(
        [sys.executable, "-m", "haustra.envs.bench.stability.long", str(folder / "grown-0"), str(steps)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert child.stdout is not None
    rows = []
    try:
        for line in child.stdout:
            rows.append(json.loads(line))
            progress(rows[-1]["steps"] / steps, f"{rows[-1]['memory_MiB']:.0f} MiB")
    finally:
        child.terminate()
        child.wait()
    if not rows:
        raise HaustraError("The long run ended before its first record: see what it wrote to stderr.")
    return judge(rows, steps)


def judge(rows: list[dict], steps: int) -> Part:
    """Bars and table of the records."""
    done = rows[-1]["steps"]
    kept = [row for row in rows if row["steps"] > done / 10] if len(rows) > 2 else rows
    count, memory = (np.array([row[name] for row in kept], float) for name in ("steps", "memory_MiB"))
    slope = float(np.polyfit(count / 1e6, memory, 1)[0]) if len(kept) > 1 else np.inf
    bars = (
        Bar("steps in one go, all finite", done if rows[-1]["healthy"] else 0, steps, "steps", "at least"),
        Bar("growth of memory per million steps", slope, GROWTH, "MiB", "at most"),
    )
    shown = tuple(rows[:: max(1, len(rows) // 10)])
    return Part(bars, (Table("A long run", shown),), summary=_SUMMARY, counts={"steps": done})


def run(colon_folder: Path, steps: int) -> None:
    """Step, and write a line of JSON now and then; ends early when the run diverges."""
    colon = load_colon(colon_folder)
    wall = wall_of(colon_folder, colon, "prism")
    options = SceneOptions()
    engine = NativeEngine(build_scene(colon, wall, named_design("adult"), options, show_lumen=False))
    rng = np.random.default_rng(0)
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
        healthy = engine.step(Inputs(rate, 0.3 * np.sin(engine.data.time), pulls), block)
        done += block
        if done % every < block or not healthy:
            seen = {
                "steps": done,
                "memory_MiB": _memory(),
                "insertion_m": engine.insertion if healthy else None,
                "healthy": healthy,
                "named": "" if healthy else divergence(engine),
                "seconds": time.perf_counter() - began,
            }
            sys.stdout.write(json.dumps(seen) + "\n")
            sys.stdout.flush()
        if not healthy:
            return


def _memory() -> float:
    """In use now [MiB]; the most that was in use where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return pages * resource.getpagesize() / 2**20
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


_SUMMARY = (
    "An adult scope is pushed into grown colon 0 (prisms) and pulled out again every 8 s, rolled and steered, in a "
    "process of its own."
)

if __name__ == "__main__":
    run(Path(sys.argv[1]), int(sys.argv[2]))
