"""Jobs on every core of this machine: child processes, started again when one dies."""

import json
import os
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from haustra.children import ONE_THREAD
from haustra.envs.study.study import Job, Result
from haustra.errors import HaustraError, InvalidOptionError

Claim: TypeAlias = Callable[[int], list[Job]]
"""Gives up to so many jobs; none when none waits."""


@dataclass(frozen=True)
class Lost:
    """Jobs whose worker died before it answered them."""

    jobs: tuple[int, ...]
    crashed: int | None = None
    """The one that the worker died of; None when it was killed from outside."""
    reason: str = ""
    alone: bool = False
    """Whether each is to be tried by itself: they took too long together, and nobody knows whose fault it is."""


Answers: TypeAlias = Iterator[Result | Lost]
JobMap: TypeAlias = Callable[[Claim], Answers]
"""Claims jobs until none waits, and gives their results as they come: one machine, or many."""

_MOST_DEATHS = 50
"""Workers that may die one after the other without a single answer before the sweep gives up."""
_LOOK_EVERY = 0.2
"""How often time limits are looked at [s]."""
_DYING_SECONDS = 10.0
"""How long a worker that closed its output may take to exit [s]."""


class WorkerPool:
    """A `JobMap` over child processes of this one."""

    def __init__(
        self,
        order: str,
        *,
        workers: int,
        batch: int,
        log: Path,
        job_seconds: float | None = None,
        together: bool = False,
    ):
        """Nothing starts yet.

        Args:
            order: From `worker.order`.
            workers: Child processes.
            batch: Jobs that a worker is given at once.
            log: File that takes what children write to stderr.
            job_seconds: Longest time for one job [s]: between two answers, or of all that a worker was given over
                their number when it answers them together.
            together: Whether it does.

        Raises:
            InvalidOptionError: when there is to be no worker.
        """
        if not 1 <= workers <= 4096:
            raise InvalidOptionError(f"A sweep with {workers} workers cannot run: give 1 to 4096.")
        self._order, self._workers, self._batch, self._limit = order, workers, batch, job_seconds
        self._together = together
        self._log, self._idle = log, list[_Child]()
        self._deaths = 0

    def __call__(self, claim: Claim) -> Answers:
        """Answer all jobs that wait. Children stay for the next call; `close` ends them."""
        busy: dict[int, _Child] = {}
        try:
            with selectors.DefaultSelector() as selector:
                while True:
                    while len(busy) < self._workers and (jobs := claim(self._batch)):
                        child = self._idle.pop() if self._idle else _Child(self._order, self._log)
                        child.give(jobs)
                        busy[child.output] = child
                        selector.register(child.output, selectors.EVENT_READ)
                    if not busy:
                        return
                    ready = {key.fd for key, _ in selector.select(_LOOK_EVERY)}
                    for output, child in list(busy.items()):
                        yield from self._answers(child, readable=output in ready)
                        if not child.jobs:
                            selector.unregister(output)
                            del busy[output]
                            if child.alive:
                                self._idle.append(child)
        finally:
            for child in busy.values():
                child.kill()

    def close(self) -> None:
        """End all children."""
        while self._idle:
            self._idle.pop().kill()

    def _answers(self, child: "_Child", *, readable: bool) -> Answers:
        if readable:
            for result in child.read():
                self._deaths = 0
                yield result
        if not child.alive:
            yield self._lost(child)
        elif child.jobs and self._late(child):
            child.kill()
            first, *rest = child.take()
            if rest and self._together:
                yield Lost((first, *rest), alone=True)
                return
            yield Result(first, "failed", reason=f"It took longer than budget.job_seconds = {self._limit:g} s.")
            yield Lost(tuple(rest))

    def _late(self, child: "_Child") -> bool:
        count = len(child.jobs) if self._together else 1
        return bool(self._limit) and time.monotonic() - child.heard > self._limit * count

    def _lost(self, child: "_Child") -> Lost:
        self._deaths += 1
        if self._deaths > _MOST_DEATHS:
            raise HaustraError(
                f"Workers died {_MOST_DEATHS} times without an answer, the last one {child.death}: what was recorded "
                f"is kept; see {self._log}, or take fewer --workers, and go on with --resume."
            )
        jobs = child.take()
        # Whoever kills with SIGKILL or SIGTERM, a user or the system short of memory, does not mean the job.
        own = bool(jobs) and child.exit_code not in (-signal.SIGKILL, -signal.SIGTERM, -signal.SIGINT)
        reason = f"It crashed its worker, which {child.death}, at every attempt."
        return Lost(tuple(jobs), crashed=jobs[0] if own else None, reason=reason)


def surroundings(backend: str, own: Mapping[str, str]) -> dict[str, str]:
    """Environment variables of a worker: one thread, and JAX on the processor where the physics is not JAX's.

    Left to itself JAX takes three quarters of a GPU in every worker, the first alone gets them, and the others die.
    What a user set in JAX_PLATFORMS stands.

    Args:
        backend: what computes the physics.
        own: those of this process.
    """
    beside = {} if backend == "warp" else {"JAX_PLATFORMS": "cpu"}
    return {**beside, **own, **ONE_THREAD}


class _Child:
    """One worker and the jobs that it has not answered."""

    def __init__(self, order: str, log: Path):
        # A session of its own: Ctrl-C reaches the parent only, which then ends its children in order.
        with log.open("ab") as complaints:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "haustra.envs.study.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=complaints,
                env=surroundings(json.loads(order)["backend"], os.environ),
                start_new_session=True,
                bufsize=0,
            )
        assert self._process.stdin is not None and self._process.stdout is not None
        self._stdin, self._stdout = self._process.stdin, self._process.stdout
        self.output = self._stdout.fileno()
        self.jobs: list[int] = []
        self.heard = time.monotonic()
        self.alive = True
        self._partial = b""
        self._write(order.encode())

    @property
    def exit_code(self) -> int:
        """Negative for a signal."""
        return self._process.wait()

    @property
    def death(self) -> str:
        """How it ended, in words."""
        code = self.exit_code
        try:
            return f"was ended by {signal.Signals(-code).name}" if code < 0 else f"exited with code {code}"
        except ValueError:
            return f"was ended by signal {-code}"

    def give(self, jobs: Sequence[Job]) -> None:
        """Let it answer these next."""
        self.jobs, self.heard = [job.id for job in jobs], time.monotonic()
        self._write((json.dumps([job.to_json() for job in jobs]) + "\n").encode())

    def take(self) -> list[int]:
        """Jobs that it has not answered; from now on none."""
        jobs, self.jobs = self.jobs, []
        return jobs

    def read(self) -> list[Result]:
        """Answers that have come; half of one waits for its end, or goes with its worker."""
        try:
            received = os.read(self.output, 1 << 20)
        except OSError:
            received = b""
        if not received:
            self._end(patience=_DYING_SECONDS)  # its own exit code says more than our signal
            return []
        self.heard = time.monotonic()
        *lines, self._partial = (self._partial + received).split(b"\n")
        results = [Result(**json.loads(line)) for line in lines]
        for result in results:
            self.jobs.remove(result.job)
        return results

    def kill(self) -> None:
        """End it at once."""
        self._end(patience=0.0)

    def _end(self, *, patience: float) -> None:
        self.alive = False
        if self._stdout.closed:
            return
        try:
            self._process.wait(timeout=patience)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for stream in (self._stdin, self._stdout):
            stream.close()

    def _write(self, text: bytes) -> None:
        try:
            view = memoryview(text)
            while view:
                view = view[self._stdin.write(view) or 0 :]
        except OSError:
            return  # it is gone, which reading from it will tell
