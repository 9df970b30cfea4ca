"""The chain in JAX against MuJoCo's own mass matrix, bias and kinematics."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from haustra.envs.sim import chain as links
from haustra.envs.sim.chain import Chain, Links
from haustra.errors import UnsupportedSceneError
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.tube_colon import straight_tube


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    options = SceneOptions(wall_law="table", softening=False, insertion_limit=0.3, gravity=(1.0, 2.0, -9.0))
    return build_scene(straight_tube(), None, named_design("adult"), options, show_lumen=False).compile()


@pytest.mark.parametrize(("kind", "tolerance"), [(np.float64, 1e-12), (np.float32, 5e-6)])
def test_mass_bias_and_places_are_those_of_mujoco(model: mujoco.MjModel, kind: type, tolerance: float) -> None:
    """Relative to the largest entry; single precision loses what subtracting distant moments loses."""
    random = np.random.default_rng(0)
    qpos, qvel = 0.3 * random.normal(size=(2, model.nv)), random.normal(size=(2, model.nv))
    chain, own = Chain.of(model), Links.of(model)
    with jax.enable_x64(kind is np.float64):
        where = links.pose(chain, own, jnp.asarray(qpos, kind))
        inertia = links.inertias(own, where)
        mass = np.asarray(links.mass_matrix(chain, where, links.suffix_sum(inertia)))
        wrenches = links.bias(
            chain, where, inertia, jnp.asarray(qvel, kind), jnp.asarray(model.opt.gravity, kind)[None]
        )
        bias = np.asarray(links.joint_forces(chain, where, links.suffix_sum(wrenches)))
        origin = np.asarray(where.origin)
    data = mujoco.MjData(model)
    for world in range(2):
        data.qpos[:], data.qvel[:] = qpos[world], qvel[world]
        mujoco.mj_forward(model, data)
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        full -= np.diag(model.dof_armature)
        np.testing.assert_allclose(mass[world], full, atol=tolerance * np.abs(full).max())
        np.testing.assert_allclose(bias[world], data.qfrc_bias, atol=tolerance * np.abs(data.qfrc_bias).max())
        np.testing.assert_allclose(origin[world], data.xpos[1:], atol=tolerance)


def test_what_is_not_one_chain_is_refused() -> None:
    branched = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><joint type='hinge'/><geom size='1'/>"
        "<body><joint/><geom size='1'/></body><body><joint/><geom size='1'/></body></body></worldbody></mujoco>"
    )
    with pytest.raises(UnsupportedSceneError, match="serial chain"):
        Chain.of(branched)
