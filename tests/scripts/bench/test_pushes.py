"""A tip that is pushed about stays inside tangent planes."""

from dataclasses import replace

from haustra.scripts.bench.pushes import Push, random_pushes, summary
from tests.tube_colon import straight_tube


def test_no_push_of_20_newtons_leaves_a_wall_of_tangent_planes():
    pushes = random_pushes(straight_tube(0.8), None, count=4, seed=0)
    found = summary(pushes)
    assert found["pushes"] == 4
    assert found["escaped"] == 0
    assert found["travelled_median_mm"] > 10  # they did push


def test_deeper_than_hooke_and_a_millimetre_is_an_escape():
    push = Push(arc=0.3, force=15.0, travelled=0.05, outside=0.0105, pressing=0.010)
    assert not push.escaped
    assert replace(push, outside=0.0115).escaped
    assert replace(push, outside=float("nan")).escaped
