"""What benchmarks say survives JSON, and a front keeps only points that nothing beats."""

import json
import math

import pytest

from haustra.scripts.bench.result import Bench, Criterion, ParetoFront, Point, Table, bench_from_json, observed_orders

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
    bars=(Criterion("order", 1.99, 1.8, "1", "at least"), Criterion("error", math.inf, 0.1, "%", "at most")),
    fronts=(FRONT,),
    tables=(Table("Costs", ({"joints": 10, "cost_s": 0.1},)),),
    machine={"cores": 2},
)


def test_a_front_keeps_what_nothing_beats() -> None:
    assert [point.setting for point in FRONT.best()] == ["joints=10", "joints=20", "joints=40"]


def test_a_bar_is_met_by_what_was_measured_only() -> None:
    order, error = BENCH.bars
    assert order.met
    assert not error.met


def test_it_survives_json() -> None:
    text = json.dumps(BENCH.to_json(), allow_nan=False)
    assert bench_from_json(json.loads(text)) == BENCH


def test_observed_orders() -> None:
    assert observed_orders([0.1, 0.05, 0.025], [4e-2, 1e-2, 2.5e-3]) == pytest.approx((2.0, 2.0))
