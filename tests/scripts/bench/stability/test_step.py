"""Largest stable steps: found where they are, not fallen, and told when a preset comes too near."""

import json

import pytest

from haustra.models.anatomy.grown import grow_colon
from haustra.models.anatomy.store import save_colon
from haustra.models.presets import PRESETS
from haustra.scripts.bench.pages.stability_page import with_figures
from haustra.scripts.bench.pages.steps_file import kept_limits
from haustra.scripts.bench.result import Bench
from haustra.scripts.bench.stability.step import FALLEN, LONGEST, find_limit, judge, references, settings
from haustra.scripts.bench.stability.step_scenes import Setting, stays_stable

SHIPPED = Setting("push in a bend", "implicitfast", "balanced")
INSERTION = Setting("insertion", "implicitfast", "balanced")


@pytest.mark.parametrize("edge", [0.0007, 0.0049, 0.0123])
def test_bisection_ends_at_the_edge(edge):
    assert edge / 1.05 <= find_limit(lambda step: step <= edge) <= edge


def test_a_limit_is_below_every_unstable_step_that_is_met():
    """Stable at 12 to 20 ms and up to 5 ms, as with locks that change there: the limit is the lower one."""
    assert find_limit(lambda step: step <= 0.005 or step >= 0.012) == pytest.approx(0.005, rel=0.05)


def test_no_limit_is_longer_than_scenes_take_and_none_is_none():
    assert find_limit(lambda step: True) == LONGEST
    assert find_limit(lambda step: False) == 0.0


@pytest.fixture(scope="module")
def grown(tmp_path_factory):
    return save_colon(grow_colon(seed=0), tmp_path_factory.mktemp("grown") / "grown-0")


@pytest.mark.parametrize("setting", [SHIPPED, INSERTION])
def test_limits_have_not_fallen(setting, grown):
    assert stays_stable(setting, FALLEN * references()[setting], grown)


def test_a_limit_is_one(grown):
    """What is above a limit does diverge, and is told: the test above can fail."""
    assert references()[INSERTION] < LONGEST
    assert not stays_stable(INSERTION, LONGEST, grown)


def test_every_preset_keeps_its_margin_in_the_reference():
    kept = references()
    for setting in settings(quick=True):
        assert kept[setting] >= 2 * PRESETS[setting.preset].modelling["timestep"]


def test_what_fell_and_what_is_near_is_told():
    asked = (SHIPPED, SHIPPED._replace(preset="fast"), SHIPPED._replace(integrator="euler"))
    before = dict.fromkeys(asked, 0.012)
    rows = [{"number": 0, "limit_s": 0.0111}, {"number": 1, "limit_s": 0.0099}, {"number": 2, "outcome": "crashed"}]
    part = judge(rows, asked, before)
    assert [criterion.measured for criterion in part.criteria] == [1, 2]
    assert [row["fallen"] for row in part.tables[0].rows] == [False, True, True]
    assert judge(rows[:1], asked, before).unfinished == "1 of 3 largest steps"


def test_figures_go_into_the_page_and_into_the_file():
    asked = (SHIPPED, SHIPPED._replace(integrator="rk4"))
    part = judge([{"number": 0, "limit_s": 0.0061}, {"number": 1, "limit_s": LONGEST}], asked, {})
    bench = Bench(
        "stability", "Stability", ("Full run.",), criteria=part.criteria, tables=part.tables, machine={"date": "today"}
    )
    page = with_figures("a\n<!-- steps -->\nold\n<!-- /steps -->\nb\n<!-- shocks -->\nkept\n<!-- /shocks -->\n", bench)
    assert "old" not in page
    assert "| push in a bend | balanced | 5 ms | 6.1 ms |  |  | ≥ 20 ms | **1.2** |" in page
    assert page.startswith("a\n")
    assert "kept" in page
    kept = kept_limits(json.loads(json.dumps(bench.to_json())))
    assert [row["limit_s"] for row in kept["limits"]] == [0.0061, LONGEST]
    assert kept["machine"] == {"date": "today"}
