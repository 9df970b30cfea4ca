"""Linear time under random settings and long runs; what is lost is told, and runs repeat to the bit."""

import json

import numpy as np
import pytest

from haustra.models.anatomy.store import save_colon
from haustra.scripts.bench.stability import linear
from haustra.scripts.bench.stability.linear_runs import WORLDS, begin, kind_of
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon


@pytest.fixture(scope="module")
def colon():
    return swept_colon(winding([(0.1, 0.0), (0.15, 1.2), (0.2, 0.0)]), name="bent tube")


def test_each_setting_of_eight_is_of_a_kind_of_its_own():
    assert len({kind_of(number) for number in range(8)}) == 8


def test_random_settings_run_in_fixed_colons_steered_by_pulls_and_wheels(colon, tmp_path):
    save_colon(colon, tmp_path / "grown-0")
    answer = begin(str(tmp_path), 0, 8, 0.8, 1)
    rows = [answer(number) for number in (0, 2)]
    assert [(row["moves"], row["wheels"]) for row in rows] == [(False, False), (False, True)]
    assert all(row["outcome"] == "finished" and row["finite"] for row in rows)
    assert all(row["world_steps"] == WORLDS * round(0.8 / row["timestep_s"]) for row in rows)
    json.dumps(rows)


def test_a_long_run_counts_its_steps_and_looks_at_memory(colon):
    row = linear.long_run(colon, 400, moves=False, threads=1)
    assert row["world_steps"] == 400 * linear.LONG_WORLDS
    assert (row["lost"], row["finite"]) == (0, True)
    assert np.isfinite(float(row["growth_MiB_per_million"] or 0.0))


def test_what_diverges_misses_the_bars():
    row = {"number": 0, "outcome": "diverged", "timestep_s": 0.005, "finite": False, "moves": True, "wheels": True}
    row |= {"real": "float32", "world_steps": 8, "fastest": 1.0, "pressing": 0.0}
    ran = {"world_steps": 10, "lost": 1, "growth_MiB_per_million": 2.0}
    part = linear.judge([row], [{"shock": "none", "outcome": "diverged"}], [ran], 1, [], steps=20)
    met = {criterion.what.removesuffix(", in linear time"): criterion.met for criterion in part.criteria}
    assert [what for what, well in met.items() if well] == [
        "settings that diverged at longer steps",
        "settings refused",
        "injections that were not caught within a block",
        "injections that changed a neighbour",
        "injections that left something not finite to read",
    ]
