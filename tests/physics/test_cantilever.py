"""Small deflections of a clamped rod under a dead tip load: v = P (L^3 - t^3) / 3EI with a rigid tip of length t.

Source: Euler-Bernoulli beam theory, e.g. Timoshenko, Strength of Materials, part I, chapter 5.
"""

import mujoco
import numpy as np

from haustra.scripts.bench.accuracy.clamped_rod import EI, LENGTH, TIP, clamped, settle, uniform_design


def deflection_error(joints: int) -> float:
    spec, cable = clamped(uniform_design(), joints)
    model = spec.compile()
    data = mujoco.MjData(model)
    total = LENGTH + TIP
    load = 1e-3
    mujoco.mj_forward(model, data)
    last = model.body(cable.links[-1]).id
    arm = total - cable.joint_positions[-1]
    # A force at the tip is a force and a moment at the last link's centre of mass.
    centre = data.xipos[last][2]
    data.xfrc_applied[last, 0] = load
    data.xfrc_applied[last, 4] = load * (total - centre)
    assert arm > 0
    settle(model, data)
    exact = load * (total**3 - TIP**3) / (3 * EI)
    return data.site("scope/tip").xpos[0] / exact - 1


def test_twenty_joints_are_within_a_tenth_of_a_percent(compare):
    compare("cantilever, small load, 20 joints: deflection over theory", 1 + deflection_error(20), 1.0, within=1e-3)


def test_the_error_falls_with_the_square_of_the_cell_length(compare):
    errors = np.abs([deflection_error(joints) for joints in (4, 8, 16, 32)])
    orders = np.log2(errors[:-1] / errors[1:])
    compare("cantilever: order of convergence", orders.min(), 2.0, within=0.1)
