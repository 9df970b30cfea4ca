"""Stages of a step are read from the backend, and make up the step."""

import pytest

from haustra.models.devices.scope.library import named_design
from haustra.scripts.bench.profile import bench_profile
from tests.tube_colon import straight_tube, wedge_wall


def test_stages_make_up_a_step_and_nothing_is_left_empty():
    bench = bench_profile(straight_tube(), wedge_wall(), named_design("adult"), before=0.5, seconds=0.5)
    stages, around, defaults = (table.rows for table in bench.tables)
    assert {row["scene"] for row in stages} >= {"scope, pieces", "scope, planes", "tracked, whole"}
    for row in stages:
        parts = [float(value or 0) for name, value in row.items() if name.endswith("_us") and name != "step_us"]
        assert 0 < sum(parts) <= 1.01 * float(row["step_us"] or 0), row
    assert [row["scene"] for row in around] == ["scope, pieces", "scope, planes"]
    assert all(float(value or 0) > 0 for row in around for name, value in row.items() if name.endswith("_us"))
    assert (
        float(defaults[0]["simulated_s"] or 0) == pytest.approx(1.0) and float(defaults[0]["real_time_factor"] or 0) > 0
    )
