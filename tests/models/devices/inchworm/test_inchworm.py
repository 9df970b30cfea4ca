"""A two-anchor inchworm: its step is its stroke less what its anchors slip."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.runs.device_run import run_device
from haustra.errors import InvalidDesignError
from haustra.models.device_scene import device_options
from haustra.models.devices.base import load_device
from haustra.models.devices.inchworm.interface import PADS, Inchworm
from haustra.models.wall.law import SLIP_SPEED
from tests.tube_colon import straight_tube


def inchworm(**changes) -> Inchworm:
    found = load_device("inchworm")
    assert isinstance(found, Inchworm)
    return replace(found, filling_time=0.5, speed=0.04, **changes)


@pytest.fixture(scope="module")
def run():
    device = inchworm()
    return run_device(device, straight_tube(0.4), device_options(device), seconds=2.95 * device.gait.period)


def test_its_step_is_its_stroke_less_slip(run):
    """Anchors creep at v_s F / (mu N) while they hold: within 5 % of theory, over a whole cycle."""
    device, told = inchworm(), run.records
    period = device.gait.period
    ends = np.interp([period, 2 * period - 0.02], told["time"], told["tip_arc"])
    holding = device.grip * PADS * device.pad_area * device.pressure
    moving = np.abs(told["body_force"])[told["time"] > period].mean()
    slip = SLIP_SPEED * moving / holding * 2 * device.gait.move
    assert ends[1] - ends[0] == pytest.approx(device.stroke - slip, rel=0.05)


def test_a_balloon_presses_by_its_pressure(run):
    """p times the side of the balloon is what the wall gives back, less what its skin takes; within 15 %."""
    device = inchworm()
    late = run.records["balloon_rear"] > 0.99 * device.pressure
    late &= run.records["balloon_front"] < 0.01 * device.pressure
    skin = 60.0 * (0.042 - device.diameter) / 2
    assert np.median(run.records["wall_force"][late]) == pytest.approx(
        device.pressure * device.pad_area - skin, rel=0.15
    )


def test_without_grip_it_comes_nowhere():
    device = inchworm(grip=0.0, tether_held=0.5)
    run = run_device(device, straight_tube(0.3), device_options(device), seconds=1.5 * device.gait.period)
    assert run.records["tip_arc"].max() - run.records["tip_arc"][0] < 1.2 * device.stroke


def test_a_balloon_is_wider_than_its_body():
    with pytest.raises(InvalidDesignError, match=r"balloon_diameter is 0.01 m; give more than the diameter"):
        inchworm(balloon_diameter=0.01)
