"""Kill a sweep's parent or one of its workers at random moments, again and again, and compare its table.

    python tests/hostile/kill_sweep.py --rounds 100

Each round runs a small sweep in a new folder. Until it is done, either the parent, which alone writes, or a worker is
killed (SIGKILL) at a random moment, from before the store exists to the writing of the tables; then it goes on with
--resume. Its results.csv must equal, byte for byte, that of a run that nothing happened to, and results.parquet too.
"""

import argparse
import json
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from os import kill
from pathlib import Path

STUDY = """
question = "propulsion"
[[variables]]
name = "spacing"
path = "drive.spacing_pitches"
unit = "1"
nominal = 3
low = 2
high = 4
levels = 24
[[variables]]
name = "pressure"
path = "design.bellows.pressure"
unit = "Pa"
nominal = 0
low = 0
high = 12000
levels = 3
[conditions]
friction = [0.2, 0.4]
speed = [0.0325]
"""
MOST_KILLS = 4
"""In a round; then the sweep is left to finish."""
TABLES = ("results.csv", "results.parquet")


def kill_rounds(folder: Path, *, rounds: int, seed: int) -> dict:
    """Run the rounds in a folder; says which ended with another table, and how often what was killed."""
    chance = random.Random(seed)
    study = folder / "study.toml"
    study.write_text(STUDY, encoding="utf-8")
    began = time.monotonic()
    _finish(study, folder / "whole")
    whole_seconds = time.monotonic() - began
    wanted = [(folder / "whole" / name).read_bytes() for name in TABLES]
    outcome = {"rounds": rounds, "seed": seed, "kills": 0, "parents": 0, "workers": 0, "different": []}
    for number in range(rounds):
        place, kills, wanted_kills = folder / f"round-{number}", 0, chance.randint(1, MOST_KILLS)
        while kills < wanted_kills:
            victim = _run_and_kill(study, place, chance, whole_seconds)
            if victim is None and kills:
                break
            if victim is None:  # it was done before: the machine has become faster, so this round begins again
                shutil.rmtree(place)
                whole_seconds *= 0.8
                continue
            kills += 1
            outcome["kills"] += 1
            outcome[victim] += 1
        _finish(study, place)
        if [(place / name).read_bytes() for name in TABLES] != wanted:
            outcome["different"].append(number)
    return outcome


def _command(study: Path, place: Path) -> list[str]:
    return [
        *(sys.executable, "-m", "haustra.scripts.main", "sweep", str(study), "-o", str(place), "--resume"),
        *("--workers", "2", "--no-report", "--json"),
    ]


def _finish(study: Path, place: Path) -> None:
    finished = subprocess.run(_command(study, place), capture_output=True, text=True, timeout=300)
    if finished.returncode != 0:
        raise RuntimeError(f"the sweep ended with {finished.returncode}: {finished.stderr[-2000:]}")
    counts = json.loads(finished.stdout)
    if (counts["finished"], counts["failed"]) != (96, 48):
        raise RuntimeError(f"jobs were lost: {counts}")


def _run_and_kill(study: Path, place: Path, chance: random.Random, whole_seconds: float) -> str | None:
    """Start the sweep, wait for a random moment, kill; None when it was done before."""
    running = subprocess.Popen(_command(study, place), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        running.wait(timeout=chance.uniform(0.1, 1.0) * whole_seconds)
        return None
    except subprocess.TimeoutExpired:
        pass
    workers = _children(running.pid)
    if workers and chance.random() < 0.5:
        with suppress(ProcessLookupError):
            kill(chance.choice(workers), signal.SIGKILL)
        if running.wait(timeout=300) != 0:
            raise RuntimeError(f"the sweep did not survive the death of a worker: {running.returncode}")
        return "workers"
    running.kill()
    running.wait()
    return "parents"


def _children(process: int) -> list[int]:
    try:
        return [int(child) for child in Path(f"/proc/{process}/task/{process}/children").read_text().split()]
    except OSError:
        return []


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        result = kill_rounds(Path(scratch), rounds=asked.rounds, seed=asked.seed)
    print(json.dumps(result))
    sys.exit(bool(result["different"]))
