"""The derivative that Newton's method relies on is the derivative of MuJoCo's own forces."""

import mujoco
import numpy as np
import pytest

from haustra.errors import UnsupportedSceneError
from haustra.models.devices.scope.rods import RODS, UniformRod, hinge_rod, plugin_rod
from haustra.scripts.bench.reference.chain import Load, SerialChain
from haustra.scripts.bench.reference.newton import NoEquilibriumError, find_equilibrium
from haustra.scripts.bench.reference.rod import static_shape

ROD = UniformRod(length=0.6, radius=8e-4, flexural_rigidity=0.064, torsional_rigidity=0.048, mass_per_length=0.016)


@pytest.fixture
def bent():
    model = hinge_rod(ROD, 6).spec.compile()
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    loads = [Load(body, rng.normal(size=3) * 0.02, rng.normal(size=3), rng.normal(size=3) * 0.1) for body in (3, 7)]
    return model, data, loads, rng.normal(size=model.nq) * 0.2


def test_forces_are_those_of_mujoco(bent):
    model, data, loads, qpos = bent
    chain = SerialChain(model)
    gravity = np.array([1.0, -2.0, -9.0])
    model.opt.gravity = gravity
    chain.place(data, qpos)
    value, _ = chain.forces(data, loads, gravity)
    mujoco.mj_forward(model, data)
    applied = np.zeros(model.nv)
    for load in loads:
        point = data.xpos[load.body] + data.xmat[load.body].reshape(3, 3) @ load.point
        mujoco.mj_applyFT(model, data, load.force, load.moment, point, load.body, applied)
    np.testing.assert_allclose(value, applied - data.qfrc_bias, atol=1e-12)


def test_the_derivative_is_that_of_the_forces(bent):
    model, data, loads, qpos = bent
    chain = SerialChain(model)
    gravity = np.array([1.0, -2.0, -9.0])

    def force(at):
        chain.place(data, at)
        return chain.forces(data, loads, gravity)

    slope = force(qpos)[1]
    small = 1e-6
    for joint in range(model.nv):
        step = np.zeros(model.nv)
        step[joint] = small
        difference = (force(qpos + step)[0] - force(qpos - step)[0]) / (2 * small)
        np.testing.assert_allclose(slope[:, joint], difference, atol=1e-7)


def test_an_equilibrium_is_one_for_mujoco(bent):
    model, data, loads, _ = bent
    found = static_shape(model, data, loads=loads, gravity=np.array([0.0, 0.0, -9.81]))
    model.opt.gravity = [0, 0, -9.81]
    mujoco.mj_forward(model, data)
    applied = np.zeros(model.nv)
    for load in loads:
        point = data.xpos[load.body] + data.xmat[load.body].reshape(3, 3) @ load.point
        mujoco.mj_applyFT(model, data, load.force, load.moment, point, load.body, applied)
    assert np.abs(data.qfrc_smooth + applied).max() < 1e-6
    assert found.iterations < 100


def test_what_has_no_equilibrium_says_so():
    def away(q):
        return np.ones(1) + q**2, 2 * np.diag(q) + 1e-6

    with pytest.raises(NoEquilibriumError, match="ramp the load"):
        find_equilibrium(away, np.array([3.0]), scale=1.0)


def test_ball_joints_are_refused():
    with pytest.raises(UnsupportedSceneError, match="single chain of hinges"):
        SerialChain(plugin_rod(ROD, 5).spec.compile())


@pytest.mark.parametrize("kind", RODS)
@pytest.mark.parametrize("joints", [5, 6])
def test_rods_have_their_mass_length_and_middle(kind, joints):
    built = RODS[kind](ROD, joints)
    model = built.spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert model.body_mass.sum() == pytest.approx(ROD.length * ROD.mass_per_length)
    for name, place, height in [(*built.tip, ROD.length), *((name, at, ROD.length / 2) for name, at, _ in built.mid)]:
        body = model.body(name).id
        point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ place
        np.testing.assert_allclose(point, [0, 0, height], atol=1e-6)
    assert sum(share for _, _, share in built.mid) == 1


def test_the_plugin_is_refused_by_name_where_it_would_be_dropped():
    with pytest.raises(UnsupportedSceneError, match="'mjx' cannot honour the rod 'cable plugin'"):
        plugin_rod(ROD, 5).require("mjx")
    with pytest.raises(UnsupportedSceneError, match="'mjx' cannot honour the rod 'hinges'"):
        hinge_rod(ROD, 5).require("mjx")
    hinge_rod(ROD, 5, cubic=False).require("mjx")
