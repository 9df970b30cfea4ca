"""The scope's cable and MuJoCo's elasticity plugin, which share no code, agree in space, with bend and twist.

The plugin's first segment is clamped rigidly and half a cell too long in effect: its error is of order one in the
segment, so two numbers of joints are extrapolated to none.
"""

import mujoco
import numpy as np
import pytest

from haustra.models.devices.scope.rods import RodModel, UniformRod, hinge_rod, plugin_rod
from haustra.scripts.bench.reference.chain import Load
from haustra.scripts.bench.reference.rod import static_shape

ROD = UniformRod(
    length=0.5,
    radius=0.004,
    flexural_rigidity=0.03,
    torsional_rigidity=0.023,
    mass_per_length=0.3,
    relaxation_time=0.3,
)
FORCE, MOMENT, GRAVITY = np.array([0.12, 0.05, -0.03]), np.array([0.01, -0.02, 0.02]), np.array([0.0, -1.0, 0.0])


def tip_at_rest(rod: RodModel) -> np.ndarray:
    """Step until still, with the plugin's forces or the hinges'."""
    option = rod.spec.option
    option.timestep, option.gravity = 0.002, GRAVITY
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model = rod.spec.compile()
    data = mujoco.MjData(model)
    name, place = rod.tip
    body = model.body(name).id
    for _ in range(200):
        for _ in range(20):
            mujoco.mj_kinematics(model, data)
            tip = data.xpos[body] + data.xmat[body].reshape(3, 3) @ place
            data.xfrc_applied[body] = [*FORCE, *(MOMENT + np.cross(tip - data.xipos[body], FORCE))]
            mujoco.mj_step(model, data)
        if np.abs(data.qvel).max() < 1e-6:
            break
    return data.xpos[body] + data.xmat[body].reshape(3, 3) @ place


def test_both_cables_bend_and_twist_alike(compare):
    coarse, fine = (tip_at_rest(plugin_rod(ROD, joints)) for joints in (19, 39))
    built = hinge_rod(ROD, 40)
    model = built.spec.compile()
    data = mujoco.MjData(model)
    body = model.body(built.tip[0]).id
    static_shape(model, data, loads=[Load(body, np.array(built.tip[1]), FORCE, MOMENT)], gravity=GRAVITY)
    ours = data.xpos[body] + data.xmat[body].reshape(3, 3) @ built.tip[1]
    straight = np.array([0, 0, ROD.length])
    assert np.linalg.norm(ours - straight) > 0.2 * ROD.length
    gap = float(np.linalg.norm(2 * fine - coarse - ours)) / ROD.length
    compare(
        "static shape of the cable, 40 joints, against MuJoCo's plugin cable: tip / L", gap, 0.0, within=1e-3, scale=1
    )
    # What the half cells are for: the plugin's own tip is an order of magnitude further off.
    assert np.linalg.norm(fine - ours) / ROD.length > 3e-3


def test_stepping_and_newtons_method_agree():
    built = hinge_rod(ROD, 20)
    stepped = tip_at_rest(built)
    model = built.spec.compile()
    data = mujoco.MjData(model)
    body = model.body(built.tip[0]).id
    static_shape(model, data, loads=[Load(body, np.array(built.tip[1]), FORCE, MOMENT)], gravity=GRAVITY)
    solved = data.xpos[body] + data.xmat[body].reshape(3, 3) @ built.tip[1]
    assert stepped == pytest.approx(solved, abs=1e-5)
