"""A free scope moves alike on every backend; a text stands where one is absent."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.models.devices.scope.library import named_design
from haustra.scripts.bench.agreement import free
from haustra.scripts.bench.agreement.free import Trial, compare_free, natively, trials
from tests.tube_colon import straight_tube


@pytest.fixture(scope="module")
def both() -> tuple[Trial, Trial]:
    return trials(straight_tube(), named_design("adult"))


def test_linear_time_bends_falls_and_is_let_go_as_mujoco_does(both) -> None:
    for trial in both:
        rows = compare_free(trial, {"linear": free.by_linear, "warp": "switched off"})
        assert [row.agrees for row in rows] == [True, True, None, None]
        assert "switched off" in rows[-1].absent


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_warp_does_too(both) -> None:
    """On a CPU its kernels take half a minute to compile."""
    pytest.importorskip("warp", reason="the extra warp is not installed")
    for trial in both:
        assert all(row.agrees for row in compare_free(trial, {"warp": lambda it: free.by_warp(it, device="cpu")}))


def test_weight_and_wire_do_something_and_rest_is_rest(both) -> None:
    """A tip that sags by a third of its length, and one that is bent by a right angle and comes back."""
    weight, wire = both
    fallen = free._tips(weight.model, natively(weight))
    assert fallen[-1, 1] < -0.08
    assert np.ptp(fallen[-10:], axis=0).max() < 1e-4
    pulled = free._tips(wire.model, natively(wire))
    assert pulled[len(pulled) // 2 - 1, 0] > 0.05
    assert abs(pulled[-1, 0]) < 1e-3


def test_another_scope_is_told_apart(both) -> None:
    """A shaft that is 0.1 % stiffer does not pass for the same."""
    weight, _ = both

    def stiffer(trial: Trial) -> np.ndarray:
        design = trial.scene.design
        shaft = tuple(replace(one, flexural_rigidity=1.001 * one.flexural_rigidity) for one in design.shaft)
        return natively(trials(straight_tube(), replace(design, shaft=shaft))[0])

    assert not any(row.agrees for row in compare_free(weight, {"stiffer": stiffer}))
