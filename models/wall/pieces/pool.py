"""Child processes that decompose blocks, each with a time limit, and started again when one crashes or hangs."""

import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable
from typing import BinaryIO

from haustra.children import ONE_THREAD
from haustra.models.wall.pieces.worker import receive, send

TOGETHER = 64
"""Blocks of which the largest goes first, so that no child is left alone with one at the end. Beyond that they keep
their order, so that what comes after can begin with the first."""
_Waiting = queue.PriorityQueue[tuple[int, int, int, bytes]]
"""Blocks by which of those they are among and by size, each with its index."""


def run_blocks(
    blocks: Iterable[bytes],
    *,
    method: str,
    tolerance: float,
    workers: int,
    limit: float,
    done: Callable[[int, bytes | None], None],
) -> None:
    """Decompose packed blocks in `workers` child processes, each as soon as `blocks` gives it.

    `done` is called in the calling thread with a block's index and its packed hulls, or None where the child crashed
    or took longer than `limit` [s].
    """
    waiting: _Waiting = queue.PriorityQueue()
    finished: queue.SimpleQueue[tuple[int, bytes | None]] = queue.SimpleQueue()
    children = [_Child(method, tolerance, limit) for _ in range(workers)]
    threads = [threading.Thread(target=child.serve, args=(waiting, finished), daemon=True) for child in children]
    left = 0
    try:
        for thread in threads:
            thread.start()
        for index, block in enumerate(blocks):
            waiting.put((index // TOGETHER, -len(block), index, block))
            left += 1
            while not finished.empty():
                done(*finished.get())
                left -= 1
        for _ in range(left):
            done(*finished.get())
    finally:
        for child in children:
            child.stop()
        for _ in children:
            # Wakes a thread, which must find its child stopped: one that did not would take another's call for a block.
            waiting.put((-1, 0, 0, b""))
        for thread in threads:
            thread.join()


class _Child:
    """One child process and the thread that talks to it."""

    def __init__(self, method: str, tolerance: float, limit: float):
        self._command = [sys.executable, "-m", "haustra.models.wall.pieces.worker", method, repr(tolerance)]
        self._limit = limit
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        self._stopped = False

    def serve(self, waiting: _Waiting, finished: queue.SimpleQueue) -> None:
        """Hand blocks to the child until it is stopped."""
        while True:
            _, _, index, block = waiting.get()
            if self._stopped:
                return
            finished.put((index, self._decompose(block)))

    def stop(self) -> None:
        """End the child for good."""
        with self._lock:
            self._stopped = True
            self._kill()

    def _decompose(self, block: bytes) -> bytes | None:
        with self._lock:
            if self._stopped:
                return None
            process = self._process = self._process or self._start()
        assert process.stdin is not None and process.stdout is not None
        timer = threading.Timer(self._limit, process.kill)
        timer.start()
        try:
            send(_binary(process.stdin), block)
            answer = receive(_binary(process.stdout))
        except (OSError, ValueError):  # the child has ended, or was ended while the block was on its way
            answer = None
        finally:
            timer.cancel()
        if answer is None:
            with self._lock:
                self._kill()
        return answer

    def _start(self) -> subprocess.Popen[bytes]:
        # A session of its own: Ctrl-C reaches the parent only, which then ends its children in order.
        return subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **ONE_THREAD},
            start_new_session=True,
        )

    def _kill(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            for stream in (process.stdin, process.stdout):
                if stream is not None:
                    _close(stream)
            process.wait()


def _binary(stream) -> BinaryIO:
    return stream


def _close(stream) -> None:
    try:
        stream.close()
    except OSError:  # bytes left to send to a child that is gone
        return
