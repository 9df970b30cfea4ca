"""Hands: gestures add up, and a device feels a smooth force at 1 kHz."""

import numpy as np
import pytest

from haustra.envs.control.hand import Gesture, HapticHandle, inputs_at
from haustra.envs.sim.native import NativeEngine
from haustra.errors import InvalidOptionError
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.tube_colon import straight_tube, wedge_wall


def engine(**options) -> NativeEngine:
    chosen = SceneOptions(insertion_limit=0.4, start_depth=0.2, **options)
    return NativeEngine(build_scene(straight_tube(), wedge_wall(), named_design("adult"), chosen, show_lumen=False))


def test_gestures_follow_each_other_and_jiggling_returns_to_where_it_was():
    plan = [Gesture(1.0, push_rate=0.02), Gesture(2.0, push_rate=-0.01, jiggle_amplitude=0.01, jiggle_frequency=3.0)]
    times = np.arange(0, 3, 1e-3) + 5e-4
    rates = np.array([inputs.push_rate for time in times if (inputs := inputs_at(plan, time))])
    assert rates[:1000] == pytest.approx(0.02)
    assert rates.sum() * 1e-3 == pytest.approx(0.02 - 0.02, abs=1e-5)
    assert np.abs(np.cumsum(rates[1000:] + 0.01) * 1e-3).max() == pytest.approx(0.01, rel=0.02)
    assert inputs_at(plan, 3.0) is None


@pytest.mark.parametrize("change", [{"duration": 0.0}, {"duration": 1.0, "jiggle_amplitude": -1.0}])
def test_impossible_gestures_are_refused(change):
    with pytest.raises(InvalidOptionError, match="gesture"):
        Gesture(**change)


def test_turning_the_handle_turns_the_tip():
    run = engine(friction=0.0)
    plan = [Gesture(1.0, roll_rate=np.pi / 2), Gesture(1.0)]
    while inputs := inputs_at(plan, run.data.time):
        run.step(inputs, 1)
    up = run.read().tip_frame[:, 0]
    assert np.arctan2(up[1], up[0]) == pytest.approx(np.pi / 2, abs=0.02)


def test_a_device_feels_a_smooth_force_at_one_kilohertz():
    """While the tip is pushed along the wall, force rises by newtons and never jumps by more than a few hundredths.

    Torque jumps more: friction at the wall holds until it lets go, within 1 mm/s (`haustra.models.wall.law`).
    """
    handle = HapticHandle(engine(friction=0.1), rate=1000.0)
    pulls = np.array([20.0, 0.0, 0.0, 0.0])
    felt = []
    for tick in range(2500):
        time = tick * handle.period
        felt.append(
            handle.advance(0.03 * np.sin(2 * np.pi * 0.5 * time) ** 2, 0.4 * np.sin(2 * np.pi * 0.7 * time), pulls)
        )
    force, torque = np.array(felt[100:]).T
    assert np.ptp(force) > 1.0
    assert np.abs(np.diff(force)).max() < 0.1 * np.ptp(force)
    assert np.abs(np.diff(torque)).max() < 0.2 * np.ptp(torque)


def test_a_device_slower_than_the_scene_is_refused():
    with pytest.raises(InvalidOptionError, match="slower"):
        HapticHandle(engine(), rate=100.0)
