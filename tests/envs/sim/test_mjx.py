"""The chain in JAX against MJX itself: the same acceleration of the same scope in the same state."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from haustra.envs.sim import chain as links
from haustra.envs.sim.chain import Chain, Links
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.tube_colon import straight_tube

mjx = pytest.importorskip("mujoco.mjx", reason="needs the extra mjx")


def test_mass_matrix_and_bias_are_those_of_mjx() -> None:
    """MJX walks link by link and its compilation grows with their number: five joints, single precision."""
    options = SceneOptions(
        wall_law="table",
        softening=False,
        insertion_limit=0.2,
        shaft_cell=0.0625,
        bending_cell=0.034,
        twist_hinges=1,
        gravity=(0, 3, -9),
    )
    model = build_scene(straight_tube(), None, named_design("adult"), options, show_lumen=False).compile()
    random = np.random.default_rng(1)
    qpos = jnp.asarray(0.3 * random.normal(size=model.nv), jnp.float32)
    qvel = jnp.asarray(random.normal(size=model.nv), jnp.float32)
    on_device = mjx.put_model(model)

    def by_mjx(qpos, qvel):
        data = mjx.make_data(model).replace(qpos=qpos, qvel=qvel)
        for stage in (mjx.kinematics, mjx.com_pos, mjx.crb, mjx.com_vel, mjx.rne):
            data = stage(on_device, data)
        return mjx.full_m(on_device, data), data.qfrc_bias

    mass, bias = jax.jit(by_mjx)(qpos, qvel)
    chain, own = Chain.of(model), Links.of(model)
    where = links.pose(chain, own, qpos[None])
    inertia = links.inertias(own, where)
    ours = links.mass_matrix(chain, where, links.suffix_sum(inertia))[0] + jnp.diag(jnp.asarray(model.dof_armature))
    wrenches = links.bias(chain, where, inertia, qvel[None], jnp.asarray(model.opt.gravity, jnp.float32)[None])
    np.testing.assert_allclose(ours, mass, atol=2e-6 * float(jnp.abs(mass).max()))
    forces = links.joint_forces(chain, where, links.suffix_sum(wrenches))[0]
    np.testing.assert_allclose(forces, bias, atol=2e-5 * float(jnp.abs(bias).max()))
