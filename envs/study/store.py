"""Jobs and their results in one SQLite file, of which one process at a time is the writer.

Every change is one transaction in write-ahead mode: whoever is killed, and whenever, the file holds what was recorded.
A job is recorded once, by a change that only a claimed job can undergo. The writer holds a lock that the system takes
from it when it dies, so whatever is still claimed when the next writer comes was lost with its claimant.
"""

import json
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from platform import node
from typing import Literal, TypeVar

from haustra.envs.study.study import Job, Result, Study
from haustra.errors import InvalidOptionError, OutputError, UnreadableFileError
from haustra.files import prepare_folder
from haustra.provenance import backend_record, package_versions

FILE, LOCK = "sweep.sqlite", "sweep.lock"
FORMAT_VERSION = 2
"""Raised when a store written before can no longer be read."""
STATES = ("pending", "claimed", "finished", "failed", "diverged")
MOST_CRASHES = 3
"""A job that crashes as many workers has failed: a crash that is the job's own repeats, bad luck seldom does."""

_BUSY_SECONDS = 30
"""How long a reader may keep the writer waiting."""
_TABLES = """
create table facts (name text primary key, value text not null);
create table sessions (
    id integer primary key, began text not null, host text not null, backend text not null, map text not null,
    versions text not null);
create table jobs (
    id integer primary key, design integer not null, variables text not null, conditions text not null,
    state text not null default 'pending' check (state in ('pending', 'claimed', 'finished', 'failed', 'diverged')),
    attempts integer not null default 0, crashes integer not null default 0, session integer references sessions,
    reason text not null default '', scores text not null default '{}', curves text not null default '{}');
create index jobs_by_state on jobs (state, crashes, id);
"""
Kind = Literal["sweep", "optimise", "sensitivity"]
Alike = Literal["nothing", "design", "conditions"]
"""What jobs that are claimed together have in common."""
_SHARED: Mapping[Alike, str] = {"nothing": "''", "design": "design", "conditions": "conditions"}
"""In SQL, what has one value in jobs that are claimed together."""
T = TypeVar("T")


class SweepStore:
    """The jobs of one folder; made by `open_store` (to write) or `read_store`."""

    def __init__(self, connection: sqlite3.Connection, folder: Path):
        self._connection, self.folder = connection, folder
        self._session: int | None = None
        self._alike: Alike = "nothing"
        facts = dict(connection.execute("select name, value from facts"))
        if facts.get("format_version") != str(FORMAT_VERSION):
            raise UnreadableFileError(f"'{folder / FILE}' is of another version: run the sweep into a new folder.")
        try:
            self.kind, self.study = facts["kind"], Study.from_json(json.loads(facts["study"]))
        except (KeyError, ValueError, TypeError) as error:
            raise UnreadableFileError(f"'{folder / FILE}' is damaged ({error}): run the sweep again.") from error

    def begin_session(self, *, backend: str, pool: str, alike: Alike = "nothing") -> None:
        """Note who computes from now on; jobs that died with an earlier claimant wait again.

        Jobs that are claimed together have in common what is to be `alike`.
        """
        self._alike = alike
        with self._writing() as connection:
            values = (_now(), node(), backend, pool, json.dumps(package_versions() | backend_record(backend)))
            cursor = connection.execute(
                "insert into sessions (began, host, backend, map, versions) values (?, ?, ?, ?, ?)", values
            )
            self._session = cursor.lastrowid
            connection.execute("update jobs set state = 'pending' where state = 'claimed'")

    def add(self, jobs: Iterable[Job]) -> None:
        """Add jobs; those that are there already stay as they are."""
        with self._writing() as connection:
            _insert(connection, jobs)

    def claim(self, most: int) -> list[Job]:
        """Up to `most` jobs that wait, which then are claimed; one alone if it crashed a worker before."""
        shared = _SHARED[self._alike]
        with self._writing() as connection:
            rows = connection.execute(
                f"select id, design, variables, conditions, crashes, {shared} from jobs where state = 'pending' "
                f"order by crashes, {shared}, id limit ?",
                (most,),
            ).fetchall()
            rows = [row for row in rows if row[4] == 0] or rows[:1]
            rows = [row for row in rows if row[5] == rows[0][5]]
            connection.executemany(
                "update jobs set state = 'claimed', attempts = attempts + 1, session = ? where id = ?",
                [(self._session, row[0]) for row in rows],
            )
        return [_job(row) for row in rows]

    def record(self, result: Result) -> bool:
        """Note how a claimed job ended; False when it was not claimed, so that nothing counts twice."""
        with self._writing() as connection:
            cursor = connection.execute(
                "update jobs set state = ?, reason = ?, scores = ?, curves = ? where id = ? and state = 'claimed'",
                (
                    result.state,
                    result.reason,
                    json.dumps(dict(result.scores), allow_nan=False),
                    json.dumps(dict(result.curves), allow_nan=False),
                    result.job,
                ),
            )
        return cursor.rowcount == 1

    def give_back(
        self, jobs: Iterable[int], *, crashed: int | None = None, reason: str = "", alone: bool = False
    ) -> None:
        """Let claimed jobs wait again, whose worker is gone; the one that crashed it fails at its last attempt.

        Those that are to be tried `alone` are claimed one by one, as what crashed a worker is.
        """
        with self._writing() as connection:
            if alone:
                jobs, apart = list(jobs), "update jobs set crashes = max(crashes, 1) where id = ?"
                connection.executemany(apart, [(job,) for job in jobs])
            if crashed is not None:
                connection.execute("update jobs set crashes = crashes + 1 where id = ?", (crashed,))
                connection.execute(
                    "update jobs set state = 'failed', reason = ? where id = ? and state = 'claimed' and crashes >= ?",
                    (reason, crashed, MOST_CRASHES),
                )
            connection.executemany(
                "update jobs set state = 'pending' where id = ? and state = 'claimed'", [(job,) for job in jobs]
            )

    def counts(self) -> dict[str, int]:
        """Number of jobs in each state."""
        found = Counter(dict(self._connection.execute("select state, count(*) from jobs group by state")))
        return {state: found[state] for state in STATES}

    def rows(self) -> Iterator[dict]:
        """Every job with its state, reason, scores, curves and provenance, in order."""
        names = (
            "id",
            "design",
            "variables",
            "conditions",
            "state",
            "reason",
            "scores",
            "curves",
            "attempts",
            "session",
        )
        for row in self._connection.execute(f"select {', '.join(names)} from jobs order by id"):
            found = dict(zip(names, row, strict=True))
            yield {**found, **{n: json.loads(found[n]) for n in ("variables", "conditions", "scores", "curves")}}

    def sessions(self) -> list[dict]:
        """Who computed, when, and with which versions."""
        names = ("id", "began", "host", "backend", "map", "versions")
        rows = self._connection.execute(f"select {', '.join(names)} from sessions order by id")
        return [{**dict(zip(names, row, strict=True)), "versions": json.loads(row[-1])} for row in rows]

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        self._connection.execute("begin immediate")
        try:
            yield self._connection
            self._connection.execute("commit")
        except BaseException:
            if self._connection.in_transaction:
                self._connection.execute("rollback")
            raise


@contextmanager
def open_store(
    folder: Path, study: Study, jobs: Callable[[], Iterable[Job]], *, kind: Kind, resume: bool
) -> Iterator[SweepStore]:
    """The store of a folder, to write; made with its jobs when there is none.

    Args:
        folder: Made when it is missing.
        study: What is asked; a store that is there must be of the same.
        jobs: Gives the jobs of a new store.
        kind: What the folder is for.
        resume: Whether to go on with a store that is there.

    Raises:
        OutputError: when the folder cannot be written, or the disk is full: what was recorded is kept.
        InvalidOptionError: when another process writes, the folder holds another study, or `resume` is missing.
    """
    prepare_folder(folder)
    with _errors(folder), _lock(folder), _connected(folder / FILE) as connection:
        connection.execute("pragma journal_mode = wal")
        connection.execute("pragma synchronous = normal")
        if not _has_begun(connection):
            _create(connection, study, jobs(), kind)
        elif not resume:
            raise InvalidOptionError(
                f"'{folder}' holds a sweep already: --resume goes on with it, or name another folder."
            )
        store = SweepStore(connection, folder)
        if store.kind != kind or store.study.hash != study.hash:
            raise InvalidOptionError(
                f"'{folder}' holds another study ('{store.study.title}', {store.kind}): name another folder."
            )
        yield store


@contextmanager
def read_store(folder: Path) -> Iterator[SweepStore]:
    """The store of a folder, to read, also while another process writes.

    Raises:
        UnreadableFileError: when there is none, or it is damaged.
    """
    if not (folder / FILE).is_file():
        raise UnreadableFileError(f"'{folder}' holds no sweep ({FILE} is missing): make one with 'haustra sweep'.")
    try:
        with _connected(folder / FILE) as connection:
            yield SweepStore(connection, folder)
    except sqlite3.Error as error:
        raise UnreadableFileError(f"'{folder / FILE}' cannot be read ({error}): run the sweep again.") from error


@contextmanager
def _connected(path: Path) -> Iterator[sqlite3.Connection]:
    connection = sqlite3.connect(path, timeout=_BUSY_SECONDS, isolation_level=None)
    try:
        yield connection
    finally:
        connection.close()


@contextmanager
def _lock(folder: Path) -> Iterator[None]:
    """Hold an exclusive lock, which ends with this process however it ends; SQLite's own works on every system."""
    lock = sqlite3.connect(folder / LOCK, timeout=0, isolation_level=None)
    try:
        try:
            lock.execute("begin exclusive")
        except sqlite3.OperationalError as error:
            if "locked" not in str(error):
                raise
            raise InvalidOptionError(f"Another process is running the sweep in '{folder}': wait for it.") from error
        yield
    finally:
        lock.close()


@contextmanager
def _errors(folder: Path) -> Iterator[None]:
    try:
        yield
    except sqlite3.DatabaseError as error:
        raise OutputError(
            f"Cannot write to '{folder}' ({error}): what was recorded is kept; make room and go on with --resume."
        ) from error


def _has_begun(connection: sqlite3.Connection) -> bool:
    """Whether anything was computed for a store: one that was made for a call which was then refused holds nothing."""
    made = connection.execute("select 1 from sqlite_master where name = 'sessions'").fetchone()
    return bool(made and connection.execute("select 1 from sessions").fetchone())


def _create(connection: sqlite3.Connection, study: Study, jobs: Iterable[Job], kind: Kind) -> None:
    connection.execute("begin immediate")
    try:
        for table in ("jobs", "sessions", "facts"):
            connection.execute(f"drop table if exists {table}")
        for statement in filter(str.strip, _TABLES.split(";")):
            connection.execute(statement)
        facts = {"format_version": str(FORMAT_VERSION), "kind": kind, "study": json.dumps(study.to_json())}
        connection.executemany("insert into facts values (?, ?)", [*facts.items(), ("created", _now())])
        _insert(connection, jobs)
        connection.execute("commit")
    except BaseException:
        if connection.in_transaction:
            connection.execute("rollback")
        raise


def _insert(connection: sqlite3.Connection, jobs: Iterable[Job]) -> None:
    connection.executemany(
        "insert or ignore into jobs (id, design, variables, conditions) values (?, ?, ?, ?)",
        ((job.id, job.design, json.dumps(dict(job.variables)), json.dumps(dict(job.conditions))) for job in jobs),
    )


def _job(row: tuple) -> Job:
    variables: Mapping = json.loads(row[2])
    return Job(row[0], row[1], variables, json.loads(row[3]))


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
