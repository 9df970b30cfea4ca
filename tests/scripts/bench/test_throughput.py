"""Rates of many worlds, and insertions timed as a whole."""

import pytest

from haustra.envs.sim.scope_colon_set import BATCH_OPTIONS, build_bank
from haustra.models.devices.scope.library import named_design
from haustra.scripts.bench.throughput import measure_insertions, measure_rates, rate_rows
from haustra.scripts.bench.worlds_accuracy import compare_with_native
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon


@pytest.mark.thorough
def test_scopes_are_timed_against_the_wall_and_stay_near_a_fine_one() -> None:
    colon, design = swept_colon(winding([(0.1, 0.0), (0.1, 0.8), (0.1, 0.0)]), name="bent tube"), named_design("adult")
    bank = build_bank([colon], design, BATCH_OPTIONS)
    rates = measure_rates(bank, [1, 8])
    assert [row["worlds"] for row in rate_rows(rates)] == [1, 8]
    for rate in rates:
        assert rate.healthy == rate.in_contact == 1.0
        assert rate.simulated_per_s == pytest.approx(rate.steps_per_s * BATCH_OPTIONS.timestep)
    found = measure_insertions(bank, 4, seconds=2.0)
    assert sum(found["outcomes"].values()) == 4 and 0 < found["reach_mean"] < 1
    apart = compare_with_native(colon, design, BATCH_OPTIONS, cell=0.02, seconds=2.0).summary()
    assert apart["tip_error_median_share"] < 0.05
