"""Means over seeds agree between the engines, and a scope with other friction does not."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("jax")

from haustra.errors import InvalidOptionError
from haustra.scripts.bench.agreement.insertions import Runs, compare_insertions, run_seeds
from haustra.scripts.bench.agreement.row import table
from tests.task_bank import short_bank

SEEDS = 8


@pytest.fixture(scope="module")
def native() -> Runs:
    return run_seeds(short_bank(), engine="native", seeds=SEEDS, seconds=6.0)


def test_insertions_into_short_bends_agree(native) -> None:
    found = run_seeds(short_bank(), engine="jax", seeds=SEEDS, seconds=6.0)
    rows = compare_insertions(native, {"jax": found, "warp": "not built"})
    assert native.diverged == found.diverged == 0
    for row in rows[:2]:  # reach and push; short runs have little wall force and looping
        assert row.agrees, row
    assert rows[-1].agrees is None


def test_other_runs_are_told_apart(native) -> None:
    harder = replace(native, push=1.15 * native.push)
    rows = {row.quantity: row for row in compare_insertions(native, {"jax": harder})}
    push = rows["insertion, mean over seeds: mean push"]
    assert push.agrees is False
    assert "DIFFERS" in table([push])[f"{push.quantity}, jax"]
    assert rows["insertion, mean over seeds: reach"].difference == 0.0


def test_an_uncertain_mean_does_not_agree(native) -> None:
    """The whole interval counts: few seeds that scatter prove nothing."""
    scattered = replace(native, reach=native.reach * (1 + 0.3 * (-1.0) ** np.arange(SEEDS)))
    row = compare_insertions(native, {"jax": scattered})[0]
    assert row.interval is not None
    assert row.interval[1] > 0.05
    assert row.agrees is False
    assert "take more seeds" in table([row])[f"{row.quantity}, jax"]


def test_lost_worlds_are_left_out_and_too_few_are_refused(native) -> None:
    lost = replace(native, reach=np.where(np.arange(SEEDS) < SEEDS - 2, np.nan, native.reach))
    with pytest.raises(InvalidOptionError, match="2 seeds"):
        compare_insertions(native, {"jax": lost})
