"""Colons that move are driven, shocked and given NaN and Inf; what is lost is told."""

from dataclasses import replace

import pytest

from haustra.models.anatomy.colon import ColonSegment
from haustra.scripts.bench.stability import moving
from haustra.scripts.bench.stability.moving_rig import MovingRig
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon


@pytest.fixture(scope="module")
def rig():
    colon = swept_colon(winding(((0.1, 0.0), (0.15, 1.6), (0.3, -1.6), (0.3, 0.0))), name="bent tube")
    length = colon.centreline.length
    return MovingRig(replace(colon, segments=(ColonSegment("sigmoid", 0.0, length),)), 8)


def test_every_bad_number_is_caught_in_its_world(rig):
    cases = moving.inject(rig)
    assert [case for case in cases if not case.sound] == []
    assert {case.array for case in cases} >= {"hands: pulls", "worlds: stiffness", "mesentery: slack"}


def test_random_mesenteries_and_shocks_are_sound_and_colons_do_move(rig):
    rows = moving.random_batch(rig, 0, 0, seconds=1.0)
    assert [row["ranges"] for row in rows] == ["inside"] * 4 + ["beyond"] * 4
    assert all(row["outcome"] == "finished" and row["finite"] for row in rows)
    shocked = moving.shocks(rig, quick=True)
    assert [row["shock"] for row in shocked] == list(moving.SHOCKS)
    # A wall that is a hundred times as stiff all at once throws so short a colon off: told, and alone in its world.
    lost = {row["shock"] for row in shocked if row["outcome"] != "finished"}
    assert lost <= {"wall stiffness times 100, back"}
    far = {row["shock"]: float(row["furthest_colon_m"] or 0.0) for row in shocked}
    assert far["mesentery and tube a tenth as stiff, back"] > far["none"] > 1e-3


def test_what_diverges_misses_the_bars(rig):
    row = {"ranges": "inside", "outcome": "diverged", "finite": False, "fastest_per_s": 1.0, "furthest_colon_m": 0.0}
    part = moving.judge([row], [{"shock": "none", "outcome": "diverged"}], 0.005, [])
    assert [criterion.met for criterion in part.criteria[:4]] == [False, False, False, False]
