"""What workers of studies are started with."""

import sys
from pathlib import Path
from typing import Any

import pytest

from haustra.envs.study import pool
from haustra.envs.study.pool import Lost, WorkerPool, surroundings
from haustra.envs.study.run import answer_all
from haustra.envs.study.sampling import designs_of, jobs_of
from haustra.envs.study.store import open_store
from haustra.envs.study.study import Job, Result
from tests.envs.study.studies import study

SLOW = """
import json, sys, time
sys.stdin.readline()
for line in sys.stdin:
    jobs = json.loads(line)
    time.sleep(sum(job["conditions"]["takes"] for job in jobs))
    for job in jobs:
        print(json.dumps({"job": job["id"], "state": "finished"}), flush=True)
"""
"""A worker that answers all its jobs together, when the last is known."""


@pytest.fixture
def slow_worker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers that sleep instead of simulating."""
    (tmp_path / "slow.py").write_text(SLOW)
    started = pool.subprocess.Popen

    def start(command: list[str], **about: Any):
        return started([sys.executable, str(tmp_path / "slow.py")], **about)

    monkeypatch.setattr(pool.subprocess, "Popen", start)


def answered(jobs: list[Job], folder: Path, *, limit: float) -> list[Result | Lost]:
    waiting = list(jobs)

    def claim(most: int) -> list[Job]:
        some, waiting[:] = waiting[:most], waiting[most:]
        return some

    about = {"workers": 1, "batch": 4, "log": folder / "log", "job_seconds": limit, "together": True}
    workers = WorkerPool('{"backend": "native"}\n', **about)  # type: ignore[arg-type]
    try:
        return list(workers(claim))
    finally:
        workers.close()


def test_workers_leave_gpus_to_those_who_step_worlds_there():
    """On a machine with a GPU each of 30 workers on cores took three quarters of its memory, and all but one died."""
    assert surroundings("linear", {"HOME": "/"})["JAX_PLATFORMS"] == "cpu"
    assert surroundings("linear-gpu", {"JAX_PLATFORMS": "cuda"})["JAX_PLATFORMS"] == "cuda", "a user's word stands"
    assert "JAX_PLATFORMS" not in surroundings("warp", {})


def test_the_time_for_one_job_is_not_that_for_all_that_are_answered_together(tmp_path: Path, slow_worker: None) -> None:
    """Four jobs of 0.5 s each answer after 2 s; none took longer than 1 s."""
    jobs = [Job(number, 0, {}, {"takes": 0.5}) for number in range(4)]
    assert [result.state for result in answered(jobs, tmp_path, limit=1.0) if isinstance(result, Result)] == 4 * [
        "finished"
    ]


def test_what_takes_too_long_together_is_tried_one_by_one_and_fails_alone(tmp_path: Path, slow_worker: None) -> None:
    jobs = [Job(0, 0, {}, {"takes": 30.0}), Job(1, 0, {}, {"takes": 0.0})]
    assert answered(jobs, tmp_path, limit=0.5) == [Lost((0, 1), alone=True)]
    (found,) = (result for result in answered(jobs[:1], tmp_path, limit=0.5) if isinstance(result, Result))
    assert found.state == "failed" and "budget.job_seconds = 0.5 s" in found.reason


def test_jobs_to_be_tried_alone_are_claimed_one_by_one_and_answered(tmp_path: Path) -> None:
    asked, claims = study(), []

    def late_together(claim):
        while jobs := claim(5):
            claims.append(len(jobs))
            if len(jobs) > 1:
                yield Lost(tuple(job.id for job in jobs), alone=True)
            else:
                yield Result(jobs[0].id, "finished", {"force_N": 1.0})

    with open_store(tmp_path, asked, lambda: jobs_of(asked, designs_of(asked)), kind="sweep", resume=False) as store:
        store.begin_session(backend="native", pool="here")
        answer_all(store, late_together)
        assert store.counts()["finished"] == 24 == claims.count(1)
