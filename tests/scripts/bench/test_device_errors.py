"""Errors of devices are ranges over colons, and none of a kind that diverged or ran in too few."""

import tomllib

from haustra.models.devices.base import load_device
from haustra.scripts.bench.device_errors import Differences, accuracy_toml, measure, ranges
from tests.tube_colon import straight_tube


def found(kind: str, *, colons: int = 10, lost: int = 0) -> Differences:
    rows = tuple({"wall_force_sum_mean": -0.01 * n if n else None, "tip_mm": 0.5 + n} for n in range(colons))
    return Differences(kind, kind, False, 2.0, rows, lost)


def test_ranges_have_no_sign_and_leave_out_runs_that_touched_nothing():
    assert ranges([found("capsule")]) == {"wall_force": (0.01, 0.09), "tip_mm": (0.5, 9.5)}


def test_what_is_stated_spans_ten_colons_and_no_run_that_diverged():
    kinds = [found("capsule"), found("vine", lost=1), found("inchworm", colons=9)]
    (entry,) = tomllib.loads(accuracy_toml(kinds, {"date": "today"}))["measured"]
    assert entry["device"] == "capsule" and entry["colons"] == 10 and entry["tip_mm"] == [0.5, 9.5]
    assert "2 s by their own drivers, against half the time step" in entry["source"]


def test_a_device_is_driven_at_its_step_and_at_half_of_it():
    one = measure(load_device("capsule"), [straight_tube(0.2)], seconds=0.2, mesentery=False)
    assert len(one.rows) == 1 and one.lost == 0
    assert one.rows[0]["wall_force_sum_mean"] is None  # it has not come to a wall yet
    assert 0 < (one.rows[0]["tip_mm"] or 0.0) < 1
