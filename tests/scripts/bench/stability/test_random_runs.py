"""Random runs: drawn from the whole ranges, finished rows kept, divergence named and counted."""

import time
from dataclasses import replace

import numpy as np
import pytest

from haustra.errors import HaustraError
from haustra.models.anatomy.store import save_colon
from haustra.models.scene import SceneOptions
from haustra.scripts.bench.stability import random_runs
from haustra.scripts.bench.stability.bench import stability
from haustra.scripts.bench.stability.part import RunOptions
from haustra.scripts.bench.stability.random_runs import judge, run_setting
from haustra.scripts.bench.stability.ranges import BEYOND, build_setting, draw, ranges
from haustra.scripts.bench.stability.rows import Rows, fill
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.scripts.bench.stability.dying import dying
from tests.tube_colon import straight_tube

MIDDLE = {variable.path: variable.at(0.5) for variable in ranges()}
TURN = np.array([0.6, 0.48, 0.64])


@pytest.fixture(scope="module")
def bend():
    return swept_colon(winding([(0.08, 0.0), (0.1, 1.6), (0.2, 0.0)]), name="bend")


def test_draws_cover_every_range_and_only_the_wider_ones_leave_it():
    variables = ranges()
    inside, wider = (draw(variables, 64, seed=0, beyond=beyond) for beyond in (0.0, BEYOND))
    assert all(variable.holds(row[variable.path]) for row in inside for variable in variables)
    for variable in variables:
        assert not all(variable.holds(row[variable.path]) for row in wider)
        spread = np.array([row[variable.path] for row in inside])
        middle = variable.at(0.5)
        assert spread.min() < middle < spread.max()


def test_the_middle_of_all_ranges_runs_and_what_was_built_unstable_is_named(bend):
    setting = build_setting(MIDDLE, wall_law="planes", turn=TURN)
    setting = replace(setting, options=replace(setting.options, insertion_limit=0.2))
    row = run_setting(setting, bend, None, np.random.default_rng(0), seconds=0.5)
    assert row["outcome"] == "finished"
    assert not row["unseen"]


def test_a_scope_that_flies_apart_is_named_and_not_averaged(bend, monkeypatch):
    """Masses of nothing, springs without damping: it cannot be stable, and must not pass for it."""
    from haustra.models.devices.scope import cable

    plain = cable._hinge

    def undamped(*args, **kwargs):
        return {**plain(*args, **kwargs), "damping": [-1e-3, 0, 0], "armature": 0.0}

    monkeypatch.setattr(cable, "_hinge", undamped)
    setting = build_setting(MIDDLE, wall_law="planes", turn=TURN)
    setting = replace(setting, options=replace(setting.options, insertion_limit=0.2, timestep=0.02))
    row = run_setting(setting, bend, None, np.random.default_rng(0), seconds=0.5)
    assert row["outcome"] == "diverged"
    assert row["reason"]
    told = {"number": 0, "beyond": False, "wall": "planes", "values": {"scene.timestep": 0.01}, **row}
    criteria = {criterion.what: criterion for criterion in judge([told], 0.5, 1).criteria}
    assert criteria["runs that diverged inside the ranges, at steps up to 10 ms"].measured == 1
    assert not criteria["runs that diverged inside the ranges, at steps up to 10 ms"].met
    assert criteria["divergences without a name, inside or beyond"].met


def test_runs_at_long_steps_are_told_apart_and_a_crash_is_never_excused():
    rows = [
        {"number": 0, "beyond": False, "wall": "planes", "outcome": "diverged", "reason": "speed"},
        {"number": 2, "outcome": "crashed"},
    ]
    rows[0]["values"] = {"scene.timestep": 0.02}
    criteria = {criterion.what: criterion for criterion in judge(rows, 10.0, 2).criteria}
    assert criteria["runs that diverged inside the ranges, at steps up to 10 ms"].measured == 1
    assert criteria["the same, at longer steps"].measured == 1


def test_ranges_end_where_options_are_refused():
    with pytest.raises(HaustraError):
        SceneOptions(timestep=max(v.high for v in ranges() if v.path == "scene.timestep") * 1.01)


def test_finished_rows_are_not_run_again(tmp_path):
    asked: list[int] = []

    def begin(offset: int):
        def answer(number: int):
            asked.append(number)
            return {"number": number, "value": number + offset}

        return answer

    def run(count: int, setting: dict):
        rows = Rows(tmp_path / "rows.jsonl", setting)
        fill(rows, count, begin, (10,), workers=1, progress=lambda done, note: None)
        return rows.first(count)

    assert [row["value"] for row in run(3, {"seed": 0})] == [10, 11, 12]
    with (tmp_path / "rows.jsonl").open("a") as file:
        file.write('{"number": 3, "val')  # the run was interrupted here
    assert len(run(5, {"seed": 0})) == 5
    assert asked == [0, 1, 2, 3, 4]
    run(2, {"seed": 1})
    assert asked == [0, 1, 2, 3, 4, 0, 1]


@pytest.mark.thorough
def test_time_that_is_up_leaves_rows_for_the_next_call_and_says_so(tmp_path):
    def run(deadline: float):
        rows = Rows(tmp_path / "rows.jsonl", {})
        fill(rows, 3, dying, (9,), workers=1, progress=lambda done, note: None, deadline=deadline)
        return [row["number"] for row in rows.first(3)]

    assert run(time.monotonic() - 1) == []
    assert run(time.monotonic() + 60) == [0, 1, 2]
    order = RunOptions(tmp_path, deadline=time.monotonic() - 1)
    kept = []
    save_colon(straight_tube(0.8), tmp_path / "colons" / "grown-0")
    found = stability(order, ["shocks", "escapes"], lambda part, done, note: None, kept.append)
    assert len(kept) == 2
    assert "0 of 10,000 pushes" in found.summary[0]
    assert all("so far, 0 of" in criterion.what for criterion in found.criteria)


def test_a_row_whose_process_dies_is_kept_as_crashed(tmp_path):
    rows = Rows(tmp_path / "rows.jsonl", {})
    fill(rows, 3, dying, (1,), workers=2, progress=lambda done, note: None)
    assert [row.get("outcome") for row in rows.first(3)] == ["fine", "crashed", "fine"]


def test_the_plan_of_a_full_run_is_the_issues():
    assert random_runs.RUNS == 1000
    assert random_runs.SECONDS == 10.0
