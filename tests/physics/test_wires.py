"""Bending angle against pull: a wire at distance r bends a section of length l by F r l / EI, in every direction.

Source: constant-curvature bending of a beam by an eccentric pull, e.g. Rucker and Webster, IEEE T-RO 27 (2011) 1033,
with a straight wire path and no friction.
"""

import mujoco
import numpy as np
import pytest

from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.scripts.bench.accuracy.clamped_rod import EI, LENGTH, clamped, settle, uniform_design

RADIUS, SECTION = 0.005, LENGTH / 2


def pulled(pulls: dict[str, float]):
    spec, _ = clamped(uniform_design(), 20)
    model = spec.compile()
    data = mujoco.MjData(model)
    for wire, pull in pulls.items():
        data.actuator(f"scope/pull_{wire}").ctrl = pull
    settle(model, data)
    return model, data


def direction_and_angle(data) -> tuple[float, float]:
    axis = data.site("scope/tip").xmat.reshape(3, 3)[:, 2]
    return np.degrees(np.arctan2(axis[1], axis[0])) % 360, np.arccos(np.clip(axis[2], -1, 1))


@pytest.mark.parametrize("wire", WIRE_NAMES)
@pytest.mark.parametrize("pull", [2.0, 40.0])
def test_angle_for_a_pull(wire, pull, compare):
    _, data = pulled({wire: pull})
    side, angle = direction_and_angle(data)
    assert (side - 90 * WIRE_NAMES.index(wire) + 180) % 360 - 180 == pytest.approx(0, abs=0.1)
    compare(f"wire '{wire}' pulled with {pull:.0f} N: angle [rad]", angle, pull * RADIUS * SECTION / EI, within=0.01)


@pytest.mark.parametrize("first", range(4))
@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_two_neighbouring_wires_bend_between_their_sides(first, share, compare):
    names = WIRE_NAMES[first], WIRE_NAMES[(first + 1) % 4]
    turn = np.pi / 2 * share
    _, data = pulled({names[0]: 30 * np.cos(turn), names[1]: 30 * np.sin(turn)})
    side, angle = direction_and_angle(data)
    expected = 90 * first + np.degrees(turn)
    assert (side - expected + 180) % 360 - 180 == pytest.approx(0, abs=0.9)
    what = f"wires '{names[0]}' and '{names[1]}' together, towards {expected:.1f} degrees: angle [rad]"
    compare(what, angle, 30 * RADIUS * SECTION / EI, within=0.01)


def test_opposite_wires_cancel():
    _, data = pulled({"up": 20.0, "down": 20.0})
    assert direction_and_angle(data)[1] < 1e-6


def test_pull_for_an_angle():
    """Held at an angle by a stiff hand on the tip, the section asks for the pull that bends it there freely."""
    model, data = pulled({"up": 12.0})
    bend = sum(data.joint(j).qpos[0] for j in range(model.njnt) if "bend_y" in model.joint(j).name)
    assert EI * bend / (RADIUS * SECTION) == pytest.approx(12.0, rel=0.01)
    # What the wire takes up is what the wheel must wind: r times the angle.
    assert -data.ten_length[model.tendon("scope/wire_up").id] == pytest.approx(RADIUS * bend, rel=1e-6)
