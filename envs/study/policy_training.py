"""Answers to the question 'policy': trainings, one after the other, each on all that the machine has."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from haustra.children import cores
from haustra.envs.learning.drivers import PolicyDriver
from haustra.envs.learning.evaluate import evaluate
from haustra.envs.learning.policy import MlpPolicy, load_policy
from haustra.envs.learning.train import train
from haustra.envs.study.policy import MEASURED, plan
from haustra.envs.study.questions import Backend, Runner, one_by_one
from haustra.envs.study.study import Job, Result, Study
from haustra.envs.tasks.bank import ColonSet, grown_bank
from haustra.envs.tasks.config import HELD_OUT_SEEDS, TaskConfig

POLICIES = "policies"
"""Folder of a study in which each job's training is left."""


def answer(study: Study, folder: Path, job: Job, *, backend: str) -> Result:
    """Train with one design, and judge what came of it beside the policy that it began as."""
    design, start, training, own = plan(study, job.variables, job.conditions)
    training = replace(training, backend=backend, device="cuda" if backend == "linear-gpu" else "cpu")
    task, threads = training.task, cores()
    grow = partial(grown_bank, design=design, difficulty=task.difficulty, processes=threads)
    held_out = grow(range(HELD_OUT_SEEDS, HELD_OUT_SEEDS + own.held_out))
    judge = partial(_judged, task=task, bank=held_out, episodes=own.episodes, backend=backend, threads=threads)
    before = judge(start)
    found, steps = before, 0
    if own.steps:
        place = folder / POLICIES / str(job.id)
        resume = (place / "checkpoint.json").exists()
        done = train(training, place, resume=resume, bank=grow(range(*task.seeds)), threads=threads)
        found, steps = judge(load_policy(place)), int(done["steps"])
    scores: dict[str, Any] = found | {f"{name}_before": value for name, value in before.items()}
    return Result(job.id, "finished", scores=scores | {"training_steps": float(steps)})


def _judged(
    policy: MlpPolicy, *, task: TaskConfig, bank: ColonSet, episodes: int, backend: str, threads: int
) -> dict[str, float]:
    """Means over episodes in colons that nobody trained in."""
    options: dict[str, Any] = {"episodes": episodes, "backend": backend, "threads": threads}
    summary = evaluate(lambda _: PolicyDriver(policy), "policy", task, bank, **options).summary()
    return {name: float(summary[name]) for name in MEASURED}


def _start(study: Study, folder: Path, *, backend: str) -> Runner:
    return one_by_one(lambda job: answer(study, folder, job, backend=backend))


LINEAR = Backend(start=partial(_start, backend="linear"), most_workers=1)
LINEAR_GPU = Backend(start=partial(_start, backend="linear-gpu"), most_workers=1)
