"""Jobs on a Ray cluster: the same map from jobs to results, over machines."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from haustra.envs.study.pool import Answers, Claim, JobMap, Lost
from haustra.envs.study.study import Result
from haustra.errors import InvalidOptionError, MissingDependencyError

LOOPBACK = "127.0.0.1"


@contextmanager
def ray_map(order: str, *, workers: int, batch: int, address: str | None) -> Iterator[JobMap]:
    """A map over Ray's tasks. Without an address a Ray of its own is started here, and ended again.

    Ray has no passwords: whoever reaches its ports can run code as this user. A local one is told to use the loopback
    address, yet its raylet and agents listen on all interfaces all the same (measured, docs/how-to/sweeps.md): start it
    behind a firewall only. A task is retried by Ray itself when its process or machine dies.

    Raises:
        MissingDependencyError: without Ray.
        InvalidOptionError: when the cluster cannot be reached.
    """
    try:
        import ray  # pyright: ignore[reportMissingImports]  # an extra that CI does not install
    except ImportError as error:
        raise MissingDependencyError("This needs Ray: install it with 'pip install haustra[ray]'.") from error
    try:
        if address is None:
            ray.init(num_cpus=workers, _node_ip_address=LOOPBACK, include_dashboard=False, log_to_driver=False)
        else:
            ray.init(address=address, log_to_driver=False)
    except (ConnectionError, OSError, RuntimeError, ValueError) as error:
        raise InvalidOptionError(
            f"Ray cannot be used ({' '.join(str(error).split())[:200]}): check --address."
        ) from error
    try:
        yield lambda claim: _answers(ray, order, claim, workers=workers, batch=batch)
    finally:
        ray.shutdown()


def _answers(ray: Any, order: str, claim: Claim, *, workers: int, batch: int) -> Answers:
    task = ray.remote(max_retries=3)(_answer).remote
    running: dict[Any, tuple[int, ...]] = {}
    while True:
        while len(running) < 2 * workers and (jobs := claim(batch)):  # one runs, one waits at its side
            text = json.dumps([job.to_json() for job in jobs])
            running[task(order, text)] = tuple(job.id for job in jobs)
        if not running:
            return
        (done,), _ = ray.wait(list(running), num_returns=1)
        ids = running.pop(done)
        try:
            lines = ray.get(done)
        except ray.exceptions.RayAccuracy as error:
            yield Lost(ids, crashed=ids[0], reason=f"Its task failed on Ray: {' '.join(str(error).split())[:300]}")
            continue
        yield from (Result(**json.loads(line)) for line in lines)


def _answer(order: str, jobs: str) -> list[str]:
    """What a task does."""
    from haustra.envs.sim.log import log_to_stderr_only
    from haustra.envs.study.worker import answer_lines

    log_to_stderr_only()
    return list(answer_lines(order, iter([jobs])))
