"""Any device natively: a scope behind the common interface, worlds apart, and what is refused by name."""

import numpy as np
import pytest

from haustra.envs.runs.device_run import run_device
from haustra.envs.sim.device_native import NativeDevice
from haustra.errors import UnsupportedSceneError
from haustra.models.device_scene import build_device_scene, device_options, device_tables
from haustra.models.devices.base import load_device
from haustra.models.devices.scope.interface import Scope
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions
from tests.tube_colon import straight_tube


@pytest.fixture(scope="module")
def tube():
    return straight_tube(0.3)


def scope() -> Scope:
    return Scope(
        name="adult", design=named_design("adult"), shaft_cell=0.0625, bending_cell=0.034, twist_hinges=1, inserted=0.4
    )


def test_a_scope_goes_as_far_as_its_hand_pushes(tube):
    run = run_device(scope(), tube, seconds=2.0)
    assert run.outcome.value == "time_up"
    assert run.records["insertion"][-1] == pytest.approx(0.03 + 2.0 * 0.03, abs=0.003)
    assert run.records["tip_arc"][-1] == pytest.approx(run.records["insertion"][-1], abs=0.003)


def test_worlds_have_conditions_of_their_own_and_one_that_is_lost_stands(tube):
    """Three equal worlds but for friction: the third is told no number, and only it is lost."""
    scene = build_device_scene(scope(), device_options())
    one = NativeDevice(scene, device_tables(scene, [tube]), worlds=3)
    one.reset(np.arange(3), np.zeros(3, int), friction=np.array([0.0, 0.5, 0.1]), wall_stiffness=np.full(3, 1500.0))
    commands = np.zeros((3, len(scene.device.controls)))
    commands[:, 0], commands[:, 2] = 0.05, 10.0
    healthy = np.ones(3, bool)
    for step in range(60):
        if step == 30:
            commands[2, 0] = np.nan
        healthy = one.step(commands, 4)
    assert healthy.tolist() == [True, True, False]
    assert np.isfinite(one.read().tip).all()
    push = one.readings()["push_force"]
    assert push[1] > push[0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (SceneOptions(wall_law="table", mesentery=True), "do not honour the option mesentery"),
        (SceneOptions(wall_law="table", twist_hinges=2), "do not honour the option twist_hinges"),
        (SceneOptions(wall_law="planes"), "wall law 'planes' is not honoured"),
        (SceneOptions(wall_law="table", gravity=(0.0, 0.0, -9.81)), "Gravity needs one colon"),
    ],
)
def test_what_is_not_honoured_is_refused_by_name(options, message):
    with pytest.raises(UnsupportedSceneError, match=message):
        build_device_scene(scope(), options)


def test_worn_wires_are_refused():
    with pytest.raises(UnsupportedSceneError, match=r"has wires\.friction, which"):
        build_device_scene(load_device("adult-worn"))
