"""A shocked scope comes to rest, and one that does not is told."""

import numpy as np
import pytest

from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.errors import InvalidOptionError
from haustra.models.anatomy.store import save_colon
from haustra.models.devices.scope.cable import PULL_OUT_LIMIT
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.scripts.bench.stability.escapes import escapes
from haustra.scripts.bench.stability.laying import lay_along
from haustra.scripts.bench.stability.long import judge as judge_long
from haustra.scripts.bench.stability.part import RunOptions
from haustra.scripts.bench.stability.shocks import SHOCKS, Shocked, judge, shock, shocks
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.tube_colon import straight_tube

BEND = swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.3, 0.0)]), name="bend")


def test_a_tip_released_from_full_bend_ends_at_rest_inside():
    (name,) = (name for name in SHOCKS if "full bend" in name)
    found = shock(straight_tube(0.4), None, name, quick=True)
    assert found.outcome == "at rest"
    assert 1 < found.fastest < 100
    assert [criterion.met for criterion in judge([found], 1).criteria] == [True, True, True, True]


def test_what_diverged_or_moves_on_misses_its_bar():
    def told(outcome, fastest):
        return Shocked("x", "planes", outcome, "", fastest, 0.1, 0.2, 0.1, 0.01, 1.0)

    assert [criterion.met for criterion in judge([told("diverged", np.inf), told("moving", 5.0)], 2).criteria] == [
        False,
        False,
        False,
        False,
    ]
    assert [criterion.measured for criterion in judge([told("diverged", 1.0), told("moving", 5.0)], 2).criteria] == [
        1,
        1,
        2,
        5.0,
    ]


def test_shocks_are_spread_and_kept(tmp_path, monkeypatch):
    monkeypatch.setattr("haustra.scripts.bench.stability.shocks.SHOCKS", dict(list(SHOCKS.items())[1:2]))
    monkeypatch.setattr("haustra.scripts.bench.stability.shocks.QUICK_AFTER", 1.0)
    save_colon(straight_tube(0.5), tmp_path / "colons" / "grown-0")
    told = []
    first = shocks(RunOptions(tmp_path, quick=True), lambda done, note: told.append(done))
    again = shocks(RunOptions(tmp_path, quick=True), lambda done, note: told.append(done))
    assert first == again
    assert told.count(1.0) == 1
    assert first.unfinished == ""


def test_faster_than_its_locks_a_shaft_is_not_pulled_out():
    options = SceneOptions(wall_law="planes", insertion_limit=0.3)
    backend = NativeEngine(build_scene(straight_tube(0.4), None, named_design("adult"), options, show_lumen=False))
    assert backend.step(Controls(-PULL_OUT_LIMIT, 0.0), 1)
    with pytest.raises(InvalidOptionError, match=r"1 m/s at most"):
        backend.step(Controls(-1.01 * PULL_OUT_LIMIT, 0.0), 1)


def test_a_bent_shaft_stands_being_pulled_out_as_fast_as_is_allowed():
    (name,) = (name for name in SHOCKS if "pulled out" in name)
    found = shock(BEND, None, name, quick=True)
    assert found.outcome == "at rest"
    assert found.fastest < 100


def test_a_scope_is_laid_along_the_centreline():
    options = SceneOptions(wall_law="planes")
    backend = NativeEngine(build_scene(BEND, None, named_design("adult"), options, show_lumen=False))
    lay_along(backend, 0.25)
    shape = backend.shape()[backend.scene.cable.node_distances < 0.24]
    apart = np.linalg.norm(shape[:, None] - BEND.centreline.points, axis=2).min(axis=1)
    assert apart.max() < 0.008
    assert np.linalg.norm(shape[-1] - shape[0]) < 0.235  # bent, not straight


def test_pushes_are_counted_in_every_colon_that_is_given(tmp_path, monkeypatch):
    monkeypatch.setattr("haustra.scripts.bench.stability.escapes.QUICK_PUSHES", 3)
    for place in (tmp_path / "colons" / "grown-0", tmp_path / "other"):
        save_colon(straight_tube(0.8), place)
    part = escapes(RunOptions(tmp_path, quick=True, colon=tmp_path / "other"), lambda done, note: None)
    assert [criterion.measured for criterion in part.criteria] == [0, 0]
    assert part.counts["pushes"] == sum(int(row["pushes"] or 0) for row in part.tables[0].rows)


def test_memory_that_grows_and_a_run_that_ends_early_miss_their_bars():
    def ran(growth, healthy=True):
        return [
            {
                "steps": step,
                "memory_MiB": 100 + growth * step,
                "healthy": healthy,
                "time_s": 1,
                "seconds": 1,
                "named": "",
            }
            for step in range(100_000, 1_000_001, 100_000)
        ]

    def row(number, records, outcome=""):
        return {"number": number, "outcome": outcome, "records": records}

    def met(rows, planned):
        return [criterion.met for criterion in judge_long(rows, planned).criteria]

    assert met([row(0, ran(3e-6)), row(1, ran(0.0))], 2_000_000) == [True, True, False]
    assert met([row(0, ran(0.0)), row(1, ran(0.0))], 2_000_000) == [True, True, True]
    assert met([row(0, ran(0.0)), row(1, ran(0.0, healthy=False), "diverged")], 2_000_000) == [False, False, True]
    assert met([row(0, ran(0.0)), {"number": 1, "outcome": "crashed"}], 2_000_000) == [False, False, True]
    assert judge_long([row(0, ran(0.0))], 2_000_000).unfinished == "1,000,000 of 2,000,000 steps"
