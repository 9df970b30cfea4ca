"""The error of a run is its difference from finer repeats, and a repeat that fell over counts for nothing."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.control.follower import FollowerSettings
from haustra.envs.runs.error import own_error, refinements
from haustra.envs.runs.insertion import Insertion, Trajectory
from haustra.envs.runs.outcome import Outcome
from haustra.models.scene import SceneOptions
from tests.tube_colon import straight_tube

COUNT = 50
ZERO = np.zeros(COUNT)


def _run(*, force: float = 2.0, push: float = 10.0, aside: float = 0.0) -> Insertion:
    plain = dict.fromkeys(Trajectory.__dataclass_fields__, ZERO)
    plain |= dict.fromkeys(("qpos", "ctrl", "pressed", "shear", "pain"), ZERO[:, None])
    tip = np.column_stack([ZERO + aside, ZERO, np.linspace(0, 0.4, COUNT)])
    blocks = {
        "coils": np.zeros((COUNT, 8, 3)),
        "displacement": np.zeros((COUNT, 0, 7)),
        "mocap_pos": np.zeros((COUNT, 0, 3)),
        "mocap_quat": np.zeros((COUNT, 0, 4)),
    }
    forces = {"wall_force_sum": ZERO + force, "wall_force": ZERO + force / 2, "push_force": ZERO - push}
    recorded = Trajectory(
        **{**plain, "time": np.arange(COUNT) * 0.02, "tip": tip, "tip_arc": tip[:, 2], **forces, **blocks}
    )
    return Insertion(
        Outcome.TIME_UP,
        recorded,
        np.zeros((2, 3)),
        np.eye(3),
        1.0,
        0,
        FollowerSettings(),
        straight_tube(),
    )


def test_differences_are_relative_and_their_range_has_no_sign():
    found = own_error(_run(), {"a": _run(force=2.5, push=9.0, aside=0.001), "b": _run(force=1.8, aside=0.004)})
    assert found.wall_force == pytest.approx((0.1, 0.25))
    assert found.push == pytest.approx((0.0, 0.1))
    assert found.tip_mm == pytest.approx((1.0, 4.0))
    assert found.differences["a"]["push_force_mean"] == pytest.approx(-0.1)
    assert found.differences["b"]["wall_force_peak"] == pytest.approx(-0.1)


def test_a_repeat_that_diverged_is_named():
    found = own_error(_run(), {"a": replace(_run(), outcome=Outcome.DIVERGED), "b": _run(force=2.2)})
    assert found.wall_force == pytest.approx((0.1, 0.1))
    assert found.measured_on.endswith("diverged: a")
    nothing = own_error(_run(), {"a": replace(_run(), outcome=Outcome.DIVERGED)})
    assert nothing.wall_force == (None, None)


def test_without_a_force_there_is_no_relative_error():
    assert own_error(_run(force=0.0), {"a": _run()}).wall_force == (None, None)


def test_repeats_have_half_the_step_and_twice_the_joints():
    steps, joints = refinements(SceneOptions()).values()
    assert steps.timestep == SceneOptions.timestep / 2 and steps.shaft_cell == SceneOptions.shaft_cell
    assert joints.bending_cell == SceneOptions.bending_cell / 2 and joints.timestep == SceneOptions.timestep
