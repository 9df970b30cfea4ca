"""A child that answers jobs: `python -m haustra.envs.study.worker`, a line of JSON in, a line of JSON out.

The first line says what is asked, each further one is a list of jobs. It ends when its parent does: jobs that nobody
will record need no answer.
"""

import json
import os
import queue
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

from haustra.envs.sim.log import log_to_stderr_only
from haustra.envs.study.questions import find_backend
from haustra.envs.study.study import Job, Study


def main() -> int:
    """Answer jobs until there are no more."""
    # What native code prints must not come between the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    lines = _lines(sys.stdin)
    log_to_stderr_only()
    for line in answer_lines(next(lines), lines):
        answers.write(line)
        answers.flush()
    return 0


def order(study: Study, backend: str, folder: Path) -> str:
    """The first line for a worker."""
    return json.dumps({"study": study.to_json(), "backend": backend, "folder": str(folder)}) + "\n"


def answer_lines(first: str, lines: Iterator[str]) -> Iterator[str]:
    """Results as lines, for an order and lists of jobs."""
    asked: dict[str, Any] = json.loads(first)
    study = Study.from_json(asked["study"])
    run = find_backend(study.question, asked["backend"]).start(study, Path(asked["folder"]))
    for line in lines:
        for result in run([Job(**job) for job in json.loads(line)]):
            yield json.dumps(result.to_json(), allow_nan=False) + "\n"


def _lines(stream: TextIO) -> Iterator[str]:
    """Lines as they come, read by a thread that ends the process with the stream, even in the midst of a job."""
    waiting: queue.SimpleQueue[str] = queue.SimpleQueue()

    def read() -> None:
        for line in stream:
            waiting.put(line)
        os._exit(0)

    threading.Thread(target=read, daemon=True).start()
    while True:
        yield waiting.get()


if __name__ == "__main__":
    sys.exit(main())
