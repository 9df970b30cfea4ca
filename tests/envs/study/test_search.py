"""Optimisation and sensitivity against what is known of the tracked robot."""

from pathlib import Path

import numpy as np
import polars
import pytest

from haustra.envs.study.optimise import run_optimise
from haustra.envs.study.run import Computing
from haustra.envs.study.sensitivity import run_sensitivity, saltelli, sobol_indices
from haustra.envs.study.store import read_store
from haustra.errors import InvalidStudyError
from tests.envs.study.studies import PRESSURE, SPACING, study

ONE, TWO = (Computing(workers=count) for count in (1, 2))
LESS = PRESSURE | {"high": 6000}


def _killed(folder: Path, asked, after: int) -> None:
    """Optimise until so many jobs are done, and stop as Ctrl-C does."""

    def stop(done: int, total: int, note: str) -> None:
        with read_store(folder) as store:
            if store.counts()["finished"] >= after:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_optimise(asked, folder, ONE, progress=stop)


def test_it_finds_half_a_pitch_and_full_bellows_and_repeats_itself_after_an_interruption(tmp_path: Path) -> None:
    """Force is largest at no pressure, ripple least at half-odd spacings (`track_ripple`): the front lies there."""
    asked = study(variables=[SPACING, LESS], conditions={"friction": [0.4], "speed": [0.0325]}, budget={"trials": 40})
    whole = run_optimise(asked, tmp_path / "whole", TWO)
    rows: list = whole["front"]  # type: ignore[assignment]
    front = polars.DataFrame(rows)
    least = front.sort("ripple_fraction").row(0, named=True)
    assert abs(least["spacing"] % 1 - 0.5) < 0.08
    assert least["ripple_fraction"] < 0.06
    assert front["force_N"].to_numpy().max() > 2.8
    _killed(tmp_path / "parts", asked, after=asked.budget.generation + 3)
    run_optimise(asked, tmp_path / "parts", ONE, resume=True)
    assert (tmp_path / "parts" / "results.csv").read_bytes() == (tmp_path / "whole" / "results.csv").read_bytes()


def test_a_design_that_fails_is_pruned_and_avoided(tmp_path: Path) -> None:
    """Above 9.4 kPa the bellows lift the tracks off: half of this range is impossible."""
    wide = PRESSURE | {"high": 19000}
    asked = study(
        variables=[SPACING, wide],
        conditions={"friction": [0.2, 0.4], "speed": [0.0325]},
        objectives=[{"score": "force_N", "goal": "maximise"}],
        budget={"trials": 40},
    )
    result = run_optimise(asked, tmp_path, ONE)
    assert result["pruned"] == result["failed"], "one job of two was run for each"
    frame = polars.read_parquet(tmp_path / "results.parquet")
    failed = frame.filter(polars.col("state") == "failed")["design"].to_numpy()
    assert np.mean(failed < 16) > 0.5 > np.mean(np.isin(np.arange(24, 40), failed)), "it learns"


def test_an_optimisation_needs_something_to_vary_and_to_reach(tmp_path: Path) -> None:
    for changes in ({"objectives": []}, {"variables": [], "sampler": {"kind": "list", "designs": [{"name": "a"}]}}):
        with pytest.raises(InvalidStudyError, match="needs"):
            run_optimise(study(**changes), tmp_path)


def test_pressure_makes_the_force_and_spacing_the_ripple(tmp_path: Path) -> None:
    asked = study(
        variables=[SPACING, LESS],
        conditions={"friction": [0.4], "speed": [0.0325]},
        sampler={"kind": "sobol", "count": 32},
    )
    result = run_sensitivity(asked, tmp_path, ONE)
    rows: list = result["indices"]  # type: ignore[assignment]
    total = {(row["score"], row["variable"]): row["total"] for row in rows}
    assert total["force_N", "spacing"] == pytest.approx(0, abs=0.01)
    assert total["force_N", "pressure_Pa"] == pytest.approx(1, abs=0.25)
    assert total["ripple_fraction", "spacing"] > 5 * total["ripple_fraction", "pressure_Pa"]
    (force,) = (row for row in rows if (row["score"], row["variable"]) == ("force_N", "pressure_Pa"))
    assert 0 < force["total_confidence"] < 0.6
    assert ("ripple_Hz", "spacing") not in total, "it is constant here"


def _known(asked, score) -> polars.DataFrame:
    """Rows of a study whose force is a known function of the variables' shares."""
    shares = saltelli(asked)
    return polars.DataFrame(
        {
            "job": np.arange(len(shares)),
            "design": np.arange(len(shares)),
            "spacing": shares[:, 0],
            "pressure_Pa": shares[:, 1],
            "force_N": [score(*share) for share in shares],
        }
    )


@pytest.mark.parametrize("failed", [0, 5])
def test_indices_are_those_of_a_function_whose_indices_are_known(failed: int) -> None:
    """y = 2 a + b + 2 a b over the unit square: variances 9/12 + 4/12 of the parts, 4/144 of the product."""
    asked = study(
        variables=[SPACING, LESS],
        conditions={"friction": [0.4], "speed": [0.0325]},
        sampler={"kind": "sobol", "count": 1024},
        scores=["force_N"],
        objectives=[],
    )
    frame = _known(asked, lambda a, b: 2 * a + b + 2 * a * b)
    if failed:
        lost = polars.Series(np.arange(len(frame)) % 400 == 3)
        frame = frame.with_columns(polars.when(lost).then(None).otherwise(polars.col("force_N")).alias("force_N"))
    indices, left_out = sobol_indices(frame, asked)
    whole = 9 / 12 + 4 / 12 + 4 / 144
    parts = {"spacing": 9 / 12 / whole, "pressure_Pa": 4 / 12 / whole}
    assert (left_out > 0) == bool(failed)
    for index in indices:
        assert index.first == pytest.approx(parts[index.variable], abs=0.04)
        assert index.total == pytest.approx(parts[index.variable] + 4 / 144 / whole, abs=0.04)


def test_a_sample_that_is_no_power_of_two_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidStudyError, match="power of two"):
        run_sensitivity(study(sampler={"count": 48}), tmp_path)
