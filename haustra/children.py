"""Processes that compute beside this one, each on one thread, and end with it however it ends."""

import os
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from threading import RLock, Thread

ONE_THREAD: dict[str, str] = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of processes that share a machine's cores: libraries that start a thread a core would fill it many times
over."""
_STARTING = RLock()
"""Held while children compute: they read the environment of this process, which is changed for them."""


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def children(count: int) -> Iterator[Executor]:
    """So many new processes.

    A pool of the standard library alone outlives a parent that is killed: its processes wait for ever, and hold what
    the parent wrote to open, so that whoever reads that waits with them.
    """
    new = get_context("spawn")
    with _STARTING, _one_thread(), ProcessPoolExecutor(count, new, initializer=_end_with_parent) as pool:
        yield pool


@contextmanager
def _one_thread() -> Iterator[None]:
    """Environment for new processes, which read it before anything of this package could change it there."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})


def _end_with_parent() -> None:
    Thread(target=_wait_for_parent, daemon=True).start()


def _wait_for_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
