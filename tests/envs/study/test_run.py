"""A sweep survives whatever happens to it, and ends with the same table."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import polars
import pytest

from haustra.envs.study.pool import Lost
from haustra.envs.study.questions import one_by_one
from haustra.envs.study.run import Computing, answer_all, run_sweep
from haustra.envs.study.sampling import designs_of, jobs_of
from haustra.envs.study.store import MOST_CRASHES, Alike, open_store, read_store
from haustra.envs.study.study import Job, Result
from haustra.errors import InvalidDesignError, InvalidOptionError, OutputError, UnreadableFileError
from haustra.scripts.main import SUCCESS, main
from tests.envs.study.studies import PRESSURE, SPACING, study, table
from tests.hostile.kill_sweep import kill_rounds

TWO = Computing(workers=2)


def _open(folder: Path, *, resume: bool = False, asked=None):
    asked = asked or study()
    return open_store(folder, asked, lambda: jobs_of(asked, designs_of(asked)), kind="sweep", resume=resume)


def _fake(claim):
    """A map that computes nothing: the job's own number."""
    while jobs := claim(5):
        for job in jobs:
            yield Result(job.id, "finished", {"force_N": float(job.id)})


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("sweep") / "a"
    result = run_sweep(study(), place, TWO)
    assert (result["finished"], result["failed"], result["diverged"]) == (16, 8, 0)
    return place


def test_every_job_has_a_row_and_what_failed_a_reason_and_no_numbers(folder: Path) -> None:
    frame = polars.read_parquet(folder / "results.parquet")
    assert frame["job"].to_list() == list(range(24))
    failed = frame.filter(polars.col("state") == "failed")
    assert failed["pressure_Pa"].unique().to_list() == [12000.0]
    assert failed["reason"].str.contains("lift the tracks off the wall").all()
    assert failed["force_N"].null_count() == len(failed)
    assert frame.filter(polars.col("state") == "finished")["force_N"].null_count() == 0


def test_csv_and_parquet_hold_the_same_bits(folder: Path) -> None:
    parquet = polars.read_parquet(folder / "results.parquet")
    assert polars.read_csv(folder / "results.csv", schema=parquet.schema).equals(parquet)


def test_every_column_is_in_the_dictionary_with_its_unit(folder: Path) -> None:
    dictionary = json.loads((folder / "results.json").read_text(encoding="utf-8"))
    columns = {entry["name"]: entry["unit"] for entry in dictionary["columns"]}
    assert list(columns) == polars.read_parquet(folder / "results.parquet").columns
    assert (columns["pressure_Pa"], columns["speed_m_s"], columns["force_N"]) == ("Pa", "m/s", "N")
    assert dictionary["sessions"][0]["versions"]["mujoco"]
    assert "| `force_N` | N | mean propulsion" in (folder / "results.md").read_text(encoding="utf-8")


def test_a_machine_without_polars_computes_and_another_writes_the_tables(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as without:
        without.setitem(sys.modules, "polars", None)
        assert run_sweep(study(), tmp_path, Computing(workers=1), tables=False)["finished"] == 16
    assert not (tmp_path / "results.csv").exists()
    run_sweep(study(), tmp_path, resume=True)
    assert (tmp_path / "results.csv").read_bytes() == (folder / "results.csv").read_bytes()


def test_the_number_of_workers_does_not_change_a_bit(folder: Path, tmp_path: Path) -> None:
    run_sweep(study(), tmp_path, Computing(workers=1))
    assert (tmp_path / "results.csv").read_bytes() == (folder / "results.csv").read_bytes()


def test_a_folder_is_not_overwritten_by_mistake(folder: Path) -> None:
    with pytest.raises(InvalidOptionError, match="--resume goes on with it"):
        run_sweep(study(), folder)
    with pytest.raises(InvalidOptionError, match="holds another study"):
        run_sweep(study(sampler={"seed": 3}), folder, resume=True)
    before = (folder / "results.csv").read_bytes()
    assert run_sweep(study(title="renamed"), folder, resume=True)["finished"] == 16
    assert (folder / "results.csv").read_bytes() == before


def test_two_writers_are_refused_a_reader_is_not(tmp_path: Path) -> None:
    with _open(tmp_path) as store:
        store.begin_session(backend="native", pool="here")
        store.claim(3)
        with pytest.raises(InvalidOptionError, match="Another process"), _open(tmp_path, resume=True):
            pass
        with read_store(tmp_path) as reader:
            assert reader.counts()["claimed"] == 3


def test_what_a_dead_writer_had_claimed_waits_again(tmp_path: Path) -> None:
    with _open(tmp_path) as store:
        store.begin_session(backend="native", pool="here")
        first = store.claim(4)
        store.record(Result(first[0].id, "finished", {"force_N": 1.0}))
    with _open(tmp_path, resume=True) as store:
        store.begin_session(backend="native", pool="here")
        assert store.counts() == {"pending": 23, "claimed": 0, "finished": 1, "failed": 0, "diverged": 0}
        assert [job.id for job in store.claim(2)] == [1, 2]


@pytest.mark.parametrize("alike", ["design", "conditions"])
def test_jobs_that_share_a_call_can_be_alike(alike: Alike, tmp_path: Path) -> None:
    def shared(jobs: Sequence[Job]) -> set[str]:
        return {str(getattr(job, alike)) for job in jobs}

    with _open(tmp_path) as store:
        total = store.counts()["pending"]
        store.begin_session(backend="native", pool="here", alike=alike)
        claimed = []
        while jobs := store.claim(total):
            assert len(shared(jobs)) == 1
            claimed.append(jobs)
        assert sum(map(len, claimed)) == total
        assert len(claimed) == len(set.union(*map(shared, claimed))) > 1, "as many as there may be, at once"


def test_nothing_is_recorded_twice(tmp_path: Path) -> None:
    with _open(tmp_path) as store:
        store.begin_session(backend="native", pool="here")
        (job,) = store.claim(1)
        assert store.record(Result(job.id, "finished", {"force_N": 1.0}))
        assert not store.record(Result(job.id, "finished", {"force_N": 2.0}))
        assert not store.record(Result(23, "finished", {"force_N": 2.0})), "it was not claimed"
        assert next(store.rows())["scores"] == {"force_N": 1.0}


def test_a_job_that_crashes_every_worker_fails_and_takes_no_other_with_it(tmp_path: Path) -> None:
    deaths = 0

    def crashing(claim):
        nonlocal deaths
        while jobs := claim(5):
            for place, job in enumerate(jobs):
                if job.id == 7:
                    deaths += 1
                    yield Lost(tuple(later.id for later in jobs[place:]), crashed=7, reason="It crashed its worker.")
                    break
                yield Result(job.id, "finished", {"force_N": float(job.id)})

    with _open(tmp_path) as store:
        store.begin_session(backend="native", pool="here")
        answer_all(store, crashing)
        assert deaths == MOST_CRASHES
        assert store.counts()["finished"] == 23
        assert [row["reason"] for row in store.rows() if row["state"] == "failed"] == ["It crashed its worker."]


def test_a_job_that_raises_fails_with_its_reason() -> None:
    def answer(job: Job) -> Result:
        raise InvalidDesignError("too thin") if job.id else ZeroDivisionError("by zero")

    results = list(one_by_one(answer)([Job(0, 0, {}, {}), Job(1, 1, {}, {})]))
    assert [(result.state, result.reason) for result in results] == [
        ("failed", "ZeroDivisionError: by zero"),
        ("failed", "too thin"),
    ]


def test_a_number_that_is_not_finite_never_becomes_a_score() -> None:
    with pytest.raises(ValueError, match="not finite"):
        Result(0, "finished", {"force_N": float("nan")})


@pytest.mark.parametrize("pages", [8, 12, 16])
def test_a_full_disk_keeps_what_was_recorded(tmp_path: Path, pages: int) -> None:
    """SQLite's own limit on pages says 'database or disk is full' as a full disk does."""
    asked = study(variables=[SPACING | {"levels": 200}])

    def filling(store):
        def answer(claim):
            store._connection.execute(f"pragma max_page_count = {pages}")
            for result in _fake(claim):
                yield Result(result.job, "finished", result.scores, curves={"long": [0.1] * 400})

        return answer

    with pytest.raises(OutputError, match=r"disk is full.*--resume"), _open(tmp_path, asked=asked) as store:
        store.begin_session(backend="native", pool="here")
        answer_all(store, filling(store))
    with _open(tmp_path, asked=asked, resume=True) as store:
        kept = store.counts()["finished"]
        store.begin_session(backend="native", pool="here")
        answer_all(store, _fake)
        assert store.counts()["finished"] == 400 > kept
        assert [row["scores"]["force_N"] for row in store.rows()] == [float(job) for job in range(400)]


def test_a_file_that_may_not_grow_ends_in_one_line_and_goes_on_later(folder: Path, tmp_path: Path) -> None:
    """The system's own limit on a file's size stands for a full disk."""
    file = tmp_path / "small.json.toml"
    file.write_text(_toml(), encoding="utf-8")
    command = ["sweep", str(file), "-o", str(tmp_path / "out"), "--json", "--no-report", "--workers", "1"]
    limited = ["bash", "-c", 'ulimit -f 60; exec "$@"', "bash", sys.executable, "-m", "haustra.scripts.main", *command]
    first = subprocess.run(limited, capture_output=True, text=True, timeout=120)
    assert first.returncode == 2, first.stderr
    assert "--resume" in first.stderr.splitlines()[-1]
    assert main([*command, "--resume"]) == SUCCESS
    assert (tmp_path / "out" / "results.csv").read_bytes() == (folder / "results.csv").read_bytes()


def test_interrupting_leaves_a_folder_that_goes_on(tmp_path: Path) -> None:
    """By Ctrl-C, which it tells in one line; then by a kill, of which it tells nothing, after one of a worker."""
    (tmp_path / "small.toml").write_text(_toml(levels=40), encoding="utf-8")
    out = tmp_path / "out"
    command = [sys.executable, "-m", "haustra.scripts.main", "sweep", str(tmp_path / "small.toml"), "-o", str(out)]
    running = subprocess.Popen([*command, "--no-report"], stderr=subprocess.PIPE, stdout=subprocess.PIPE)
    _wait_for_more(running, out, 0)
    running.send_signal(signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 130, said
    assert b"interrupted" in said
    kept = _counted(out)
    assert 0 < kept < 160
    again = [*command, "--resume", "--no-report", "--workers", "2"]
    running = subprocess.Popen(again, stderr=subprocess.PIPE, stdout=subprocess.PIPE)
    _wait_for_more(running, out, kept)
    worker = Path(f"/proc/{running.pid}/task/{running.pid}/children").read_text().split()
    for child in worker[:1]:
        os.kill(int(child), signal.SIGKILL)
    _wait_for_more(running, out, _counted(out))
    running.kill()
    _, said = running.communicate(timeout=60)
    assert running.returncode in (-signal.SIGKILL, 0), said
    one = Computing(workers=1)
    whole = run_sweep(study(variables=[SPACING | {"levels": 40}, PRESSURE | {"levels": 3}]), out, one, resume=True)
    assert (whole["finished"], whole["failed"], whole["diverged"]) == (160, 80, 0)


def _wait_for_more(running: subprocess.Popen[bytes], folder: Path, before: int) -> None:
    """Wait until a sweep has finished more jobs than there were before, or is over."""
    while running.poll() is None and _counted(folder) <= before:
        time.sleep(0.05)


def _counted(folder: Path) -> int:
    try:
        with read_store(folder) as store:
            return store.counts()["finished"]
    except (UnreadableFileError, sqlite3.Error):
        return 0


@pytest.mark.thorough
def test_killed_at_random_moments_it_ends_with_the_same_table(tmp_path: Path) -> None:
    """One round of the harness, which was run for a hundred.

    `make test` kills a worker and the parent once (`test_interrupting_leaves_a_folder_that_goes_on`), and compares the
    table of a sweep that broke off (`test_a_file_that_may_not_grow_ends_in_one_line_and_goes_on_later`).
    """
    outcome = kill_rounds(tmp_path, rounds=1, seed=int.from_bytes(os.urandom(4), "little"))
    assert outcome["different"] == []
    assert outcome["kills"] >= 1


def test_a_damaged_store_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnreadableFileError, match="holds no sweep"), read_store(tmp_path):
        pass
    (tmp_path / "sweep.sqlite").write_bytes(b"no database" * 1000)
    with pytest.raises(UnreadableFileError, match="cannot be read"), read_store(tmp_path):
        pass
    with pytest.raises(OutputError), _open(tmp_path, resume=True):
        pass


def _toml(**changes) -> str:
    """The small study as text."""
    lines = ['question = "propulsion"']
    for name in ("variables", "objectives"):
        for entry in table()[name]:
            lines += [
                f"[[{name}]]",
                *(f"{key} = {value!r}" for key, value in {**entry, **_levels(entry, changes)}.items()),
            ]
    return "\n".join([*lines, "[conditions]", "friction = [0.2, 0.4]", "speed = [0.0325]", ""])


def _levels(entry: dict, changes: dict) -> dict:
    return changes if entry.get("name") == "spacing" else {}
