"""Finished rows of a long benchmark, one a line of JSON, so that an interrupted run goes on where it stopped."""

import json
import math
import time
from collections.abc import Callable, Mapping
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, TypeAlias

from haustra.errors import OutputError

Row: TypeAlias = dict[str, Any]
Answer: TypeAlias = Callable[[int], Row]
"""Gives the row of a number."""


class Rows:
    """A file of rows, each with its `number`."""

    def __init__(self, path: Path, setting: Mapping[str, Any]) -> None:
        """Read the rows that were finished under the same `setting`; those of another are dropped.

        Raises:
            OutputError: when the file cannot be written.
        """
        self._path = path
        head = json.dumps({"setting": dict(setting)}, sort_keys=True)
        self.found: dict[int, Row] = {}
        try:
            lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
            if lines and lines[0] == head:
                self.found = {row["number"]: row for row in map(_row, lines[1:]) if row is not None}
            text = "".join(f"{line}\n" for line in (head, *map(json.dumps, self.found.values())))
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise OutputError(f"Cannot write '{path}': {error.strerror or error}. Name another folder.") from error

    def add(self, row: Row) -> None:
        """Keep a finished row."""
        self.found[row["number"]] = row
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")

    def first(self, count: int) -> list[Row]:
        """Finished rows among the first `count`, in order."""
        return [self.found[number] for number in range(count) if number in self.found]


def _row(line: str) -> Row | None:
    try:
        return json.loads(line)
    except json.JSONDecodeError:
        return None  # half a line is what an interrupted run leaves


def fill(
    rows: Rows,
    count: int,
    begin: Callable[..., Answer],
    given: tuple[Any, ...],
    *,
    workers: int,
    progress: Callable[[float, str], None],
    deadline: float = math.inf,
) -> None:
    """Answer all of the first `count` rows that are missing, in this process or in children, as time allows.

    A row whose child dies is kept as `crashed`: native code can end a process, and that is a finding.

    Args:
        rows: takes the answers.
        count: how many there are to be.
        begin: called with `given` once in each process; what it returns answers rows. Top level of a module, since
            children import it.
        given: arguments of `begin`.
        workers: child processes; none for 1.
        progress: told the share that is done.
        deadline: no row is begun after that [s, as `time.monotonic` counts]; those begun are finished.
    """
    missing = [number for number in range(count) if number not in rows.found]

    def keep(row: Row) -> None:
        rows.add(row)
        progress(len(rows.first(count)) / count, f"{row['number']}: {row.get('outcome', '')}")

    def more() -> bool:
        return bool(missing) and time.monotonic() < deadline

    if workers == 1:
        answer = begin(*given) if more() else None
        while answer and more():
            keep(answer(missing.pop(0)))
        return
    children = [_Child(begin, given) for _ in range(min(workers, len(missing)) if more() else 0)]
    try:
        while children:
            for child in children:
                if child.number is None and more():
                    child.ask(missing.pop(0))
            busy = {child.pipe: child for child in children if child.number is not None}
            if not busy:
                break
            for pipe in wait(list(busy)):
                child = busy[pipe]  # type: ignore[index]
                row = child.answer()
                if row is None:
                    row = {"number": child.number, "outcome": "crashed"}
                    children[children.index(child)] = _Child(begin, given)
                keep(row)
    finally:
        for child in children:
            child.end()


class _Child:
    """A process that answers one row after another."""

    def __init__(self, begin: Callable[..., Answer], given: tuple[Any, ...]) -> None:
        context = get_context("spawn")
        self.pipe, other = context.Pipe()
        self.number: int | None = None
        self._process = context.Process(target=_serve, args=(other, begin, given), daemon=True)
        self._process.start()
        other.close()

    def ask(self, number: int) -> None:
        self.number = number
        self.pipe.send(number)

    def answer(self) -> Row | None:
        """None when the child has died; its number stays then."""
        try:
            row = self.pipe.recv()
        except EOFError:
            return None
        self.number = None
        return row

    def end(self) -> None:
        self._process.terminate()
        self._process.join()


def _serve(pipe: Connection, begin: Callable[..., Answer], given: tuple[Any, ...]) -> None:
    answer = begin(*given)
    try:
        while True:
            pipe.send(answer(pipe.recv()))
    except (EOFError, KeyboardInterrupt):
        return
