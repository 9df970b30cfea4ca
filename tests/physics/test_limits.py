"""Stops: the bending section ends at its angle in each of four directions, a shaft at its smallest radius."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from haustra.models.devices.scope.design import BendingLimits
from haustra.scripts.bench.accuracy.clamped_rod import LENGTH, clamped, settle, uniform_design


@pytest.mark.parametrize(("wire", "angle"), [("up", 100.0), ("left", 70.0), ("down", 50.0), ("right", 30.0)])
def test_four_directions_have_their_own_limits(wire, angle):
    design = replace(uniform_design(), limits=BendingLimits(up=100, left=70, down=50, right=30))
    model = clamped(design, 20)[0].compile()
    data = mujoco.MjData(model)
    data.actuator(f"scope/pull_{wire}").ctrl = 60.0
    settle(model, data)
    bend = np.degrees(np.arccos(data.site("scope/tip").xmat.reshape(3, 3)[2, 2]))
    assert bend == pytest.approx(angle, abs=1.2)


@pytest.mark.parametrize("side", [0.0, 22.5, 45.0, 80.0])
def test_a_shaft_does_not_bend_tighter_than_its_radius(side, compare):
    """Hinges stop where two neighbours together bend 92 to 100 % of what is allowed, whatever the direction."""
    design = uniform_design()
    design = replace(design, shaft=(replace(design.shaft[0], minimum_bend_radius=0.2),))
    spec, cable = clamped(design, 20)
    model = spec.compile()
    data = mujoco.MjData(model)
    axis = np.array([-np.sin(np.radians(side)), np.cos(np.radians(side)), 0.0])
    data.xfrc_applied[model.body(cable.links[10]).id, 3:] = 0.5 * axis
    settle(model, data)
    frame = data.body(cable.links[10]).xmat.reshape(3, 3)
    bend = np.arccos(frame[2, 2])
    largest, free = LENGTH / 2 / 0.2, 0.5 / 0.03 * LENGTH / 2
    assert bend < 0.5 * free
    compare(f"stops of a shaft, bent towards {side:.1f} degrees: bend / largest", bend / largest, 0.96, within=0.07)
