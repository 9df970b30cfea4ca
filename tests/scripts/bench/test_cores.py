"""Ratios of cores, at a size for tests: how large they are is the machine's business."""

import math

from haustra.scripts.bench.cores import measure_cores
from tests.task_bank import short_bank


def test_three_ratios_are_measured_in_one_run():
    told: list[float] = []
    found = measure_cores(
        short_bank(),
        cores=2,
        worlds=2,
        before=5.0,
        repeats=1,
        seconds=0.1,
        progress=lambda done, note: told.append(done),
    )
    for ratio in (found.processes, found.mujoco, found.scopes):
        assert 0 < ratio < math.inf  # timings of a tenth of a second on a shared machine
    assert found.contacts > 0
    assert math.isfinite(found.steps_per_s)
    assert told == [0, 1]
