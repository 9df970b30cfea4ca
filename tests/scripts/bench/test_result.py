"""What benchmarks say survives JSON, and a front keeps only points that nothing beats."""

import json
import math

import numpy as np
import pytest

from haustra.scripts.bench.result import (
    Bench,
    Criterion,
    ParetoFront,
    Point,
    Table,
    bench_from_json,
    equivalence,
    observed_orders,
)

FRONT = ParetoFront(
    question="How far does it bend?",
    reference="elastica",
    error_unit="% of length",
    cost_unit="s/s",
    points=(
        Point("joints=10", 1.0, 0.1),
        Point("joints=20", 0.25, 0.2),
        Point("joints=20, timestep=0.001", 0.3, 0.9, group="timestep"),
        Point("joints=40", 0.06, 0.4),
        Point("timestep=0.02", math.inf, 0.05, group="timestep", outcome="diverged"),
    ),
)
BENCH = Bench(
    name="accuracy",
    title="Run time against error",
    summary=("Measured.",),
    criteria=(
        Criterion("order", 1.99, 1.8, "1", "at least"),
        Criterion("error", math.inf, 0.1, "%", "at most"),
        Criterion("mean", 0.02, 0.1, "1", "within", (-0.01, 0.05)),
        Criterion("mean of few", 0.02, 0.1, "1", "within", (-math.inf, math.inf)),
    ),
    fronts=(FRONT,),
    tables=(Table("Costs", ({"joints": 10, "cost_s": 0.1},)),),
    machine={"cores": 2},
)


def test_a_front_keeps_what_nothing_beats() -> None:
    assert [point.setting for point in FRONT.best()] == ["joints=10", "joints=20", "joints=40"]


def test_a_bar_is_met_by_what_was_measured_only() -> None:
    order, error, *_ = BENCH.criteria
    assert order.met
    assert not error.met


def test_a_mean_is_shown_by_its_whole_interval() -> None:
    assert [criterion.verdict for criterion in BENCH.criteria] == ["met", "not met", "met", "not shown"]
    assert Criterion("mean", 0.3, 0.1, "1", "within", (0.2, 0.4)).verdict == "not met"
    assert Criterion("mean", 0.12, 0.1, "1", "within", (0.05, 0.19)).verdict == "not shown"


def test_fewer_cases_never_turn_a_fail_into_a_pass() -> None:
    """A true difference at the tolerance passes in 2.5 % of samples at most, however few cases there are."""
    draw = np.random.default_rng(0)
    shares = {}
    for count in (3, 9, 10, 40, 256):
        found = [equivalence("", draw.normal(0.1, 0.1, count), tolerance=0.1, unit="1") for _ in range(400)]
        shares[count] = np.mean([criterion.met for criterion in found])
    assert shares[3] == shares[9] == 0.0
    assert max(shares.values()) < 0.05
    off = 0.2 + 0.01 * (-1.0) ** np.arange(256)
    assert equivalence("", off, tolerance=0.1, unit="1").verdict == "not met"
    assert equivalence("", off[:5], tolerance=0.1, unit="1").verdict == "not shown"
    assert equivalence("", 0.01 + 0.001 * (-1.0) ** np.arange(10), tolerance=0.1, unit="1").verdict == "met"


def test_it_survives_json() -> None:
    text = json.dumps(BENCH.to_json(), allow_nan=False)
    assert bench_from_json(json.loads(text)) == BENCH


def test_observed_orders() -> None:
    assert observed_orders([0.1, 0.05, 0.025], [4e-2, 1e-2, 2.5e-3]) == pytest.approx((2.0, 2.0))
