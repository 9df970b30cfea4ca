"""Where the chain in JAX is, against MuJoCo's own kinematics."""

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
from tests.task_bank import COARSE
from tests.tube_colon import straight_tube


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    options = SceneOptions(wall_law="table", softening=False, insertion_limit=0.3, **COARSE)
    return build_scene(straight_tube(), None, named_design("adult"), options, show_lumen=False).compile()


# The laws are the same in single precision: double holds them closer.
@pytest.mark.parametrize(
    ("kind", "tolerance"), [(np.float64, 1e-12), pytest.param(np.float32, 5e-6, marks=pytest.mark.thorough)]
)
def test_places_are_those_of_mujoco(model: mujoco.MjModel, kind: type, tolerance: float) -> None:
    """Compared for a point on each link, a centimetre along and across."""
    random = np.random.default_rng(0)
    qpos = 0.3 * random.normal(size=(2, model.nv))
    chain, bodies, local = Chain.of(model), np.arange(model.nbody - 1), np.array([0.01, 0.0, 0.01])
    with jax.enable_x64(kind is np.float64):
        own = jax.tree.map(lambda part: jnp.asarray(part, kind), Links.of(model))
        on = jnp.tile(jnp.asarray(local, kind), (1, len(bodies), 1))
        points = jax.jit(lambda angles: links.points_on(links.pose(chain, own, angles), bodies, on))(
            jnp.asarray(qpos, kind)
        )
    data = mujoco.MjData(model)
    for world in range(2):
        data.qpos[:] = qpos[world]
        mujoco.mj_forward(model, data)
        places = data.xpos[1:] + data.xmat[1:].reshape(-1, 3, 3) @ local
        np.testing.assert_allclose(points[world], places, atol=tolerance)


def test_what_is_not_one_chain_is_refused() -> None:
    branched = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><joint type='hinge'/><geom size='1'/>"
        "<body><joint/><geom size='1'/></body><body><joint/><geom size='1'/></body></body></worldbody></mujoco>"
    )
    with pytest.raises(UnsupportedSceneError, match="serial chain"):
        Chain.of(branched)
