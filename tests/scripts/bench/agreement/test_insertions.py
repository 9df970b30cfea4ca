"""Means over seeds agree between the backends, and a scope with other friction does not."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from haustra.errors import InvalidOptionError
from haustra.scripts.bench.agreement import insertions as insertions_module
from haustra.scripts.bench.agreement.insertions import Runs, compare_insertions, insertions, run_seeds
from haustra.scripts.bench.agreement.row import table
from tests.task_bank import short_bank

SEEDS = 12


@pytest.fixture(scope="module")
def native() -> Runs:
    return run_seeds(short_bank(), backend="native", seeds=range(SEEDS), seconds=6.0)


def test_insertions_into_short_bends_agree(native) -> None:
    found = run_seeds(short_bank(), backend="linear", seeds=range(SEEDS), seconds=6.0)
    rows = compare_insertions(native, {"linear": found, "warp": "not built"})
    assert native.diverged == found.diverged == 0
    for row in rows[:2]:  # reach and push; short runs have little wall force and looping
        assert row.difference is not None and abs(row.difference) < 0.1, row
    assert rows[-1].agrees is None


def test_other_runs_are_told_apart(native) -> None:
    harder = replace(native, push=1.15 * native.push)
    rows = {row.quantity: row for row in compare_insertions(native, {"linear": harder})}
    push = rows["insertion, colons fixed, mean over seeds: mean push"]
    assert push.agrees is False
    assert "DIFFERS" in table([push])[f"{push.quantity}, linear"]
    assert rows["insertion, colons fixed, mean over seeds: reach"].difference == 0.0


def test_an_uncertain_mean_does_not_agree(native) -> None:
    """The whole interval counts: few seeds that scatter prove nothing."""
    scattered = replace(native, reach=native.reach * (1 + 0.3 * (-1.0) ** np.arange(SEEDS)))
    row = compare_insertions(native, {"linear": scattered})[0]
    assert row.interval is not None
    assert row.interval[1] > 0.05
    assert row.agrees is False
    assert "take more seeds" in table([row])[f"{row.quantity}, linear"]


def test_lost_worlds_are_left_out_and_too_few_are_refused(native) -> None:
    lost = replace(native, reach=np.where(np.arange(SEEDS) < SEEDS - 2, np.nan, native.reach))
    with pytest.raises(InvalidOptionError, match="2 seeds"):
        compare_insertions(native, {"linear": lost})


def test_few_seeds_show_nothing_however_little_they_scatter(native) -> None:
    few = Runs(*(getattr(native, name)[:9] for name in Runs.__dataclass_fields__))
    assert not any(row.agrees for row in compare_insertions(few, {"linear": few}))
    assert all(row.agrees for row in compare_insertions(native, {"linear": native}))
    (reach, *_) = compare_insertions(native, {"linear": native})
    assert reach.to_json()["half_width"] == 0.0 and reach.to_json()["cases"] == SEEDS


def test_finished_insertions_are_kept_and_processes_change_nothing(tmp_path) -> None:
    alone = run_seeds(short_bank(), backend="native", seeds=range(4), seconds=0.6)
    asked = {"backend": "native", "mesentery": False, "seeds": 4, "seconds": 0.6, "folder": tmp_path}
    monkeys = pytest.MonkeyPatch()
    with monkeys.context() as patch:
        patch.setattr(insertions_module, "_PER_PROCESS", 2)
        found = insertions(short_bank(), **asked, processes=2)
        files = sorted(tmp_path.rglob("*.npz"))
        assert len(files) == 2
        before = [file.stat().st_mtime_ns for file in files]
        files[1].unlink()
        patch.setattr(insertions_module, "ProcessPoolExecutor", lambda count, **_: ThreadPoolExecutor(count))
        again = insertions(short_bank(), **asked, processes=2)
    assert files[0].stat().st_mtime_ns == before[0] and files[1].is_file()
    for name in Runs.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(found, name), getattr(alone, name))
        np.testing.assert_array_equal(getattr(again, name), getattr(alone, name))


def test_a_backend_that_refuses_is_absent_with_its_reason() -> None:
    (row,) = compare_insertions(None, {"linear": "no such colon"}, mesentery=True)
    assert row.absent == "no such colon" and "on the mesentery" in row.quantity


def test_insertions_by_other_steps_are_kept_apart(tmp_path) -> None:
    asked = {"backend": "linear", "mesentery": False, "seeds": 3, "seconds": 0.4, "folder": tmp_path}
    bank = short_bank()
    finer = replace(bank, options=replace(bank.options, timestep=0.0025))
    first, second = (insertions(each, **asked) for each in (bank, finer))
    assert isinstance(first, Runs) and isinstance(second, Runs)
    assert len(list(tmp_path.rglob("*.npz"))) == 2
    assert not np.array_equal(first.push, second.push)
