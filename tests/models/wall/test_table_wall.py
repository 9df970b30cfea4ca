"""One sphere on the wall of a tube that MuJoCo steps, held to the contact law in closed form.

Theory: at rest E(d) is the load; at a steady speed v friction is (mu + m v) times the load
(`haustra.models.wall.law`).
"""

import mujoco
import numpy as np
import pytest

from haustra.models.scene import SceneOptions, empty_spec
from haustra.models.wall.elasticity import ELASTICITIES, depth_under
from haustra.models.wall.lumen_table import lumen_table
from haustra.models.wall.planes import Sample, add_planes
from haustra.models.wall.table_wall import TableWall
from tests.tube_colon import RADIUS, straight_tube

BALL, LENGTH = 0.006, 0.3
"""Radius of the ball, and length of the tube [m]."""
LOAD = 12.0
"""Force that presses on the wall [N]."""


def pushed(options: SceneOptions, *, along: float, steps: int) -> tuple[float, float, TableWall]:
    """How deep a ball is in the wall [m] and how fast it slides [m/s], loaded sideways and pushed along the tube.

    The table's wall stands 0.02 mm further out than the tube's.
    """
    spec = empty_spec("ball", options)
    body = spec.worldbody.add_body(name="ball", pos=[RADIUS - BALL, 0, 0.05])
    for axis in ([1, 0, 0], [0, 0, 1]):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[BALL, 0, 0], mass=0.05, contype=0, conaffinity=0)
    samples = (Sample("ball", np.zeros(3), BALL),)
    add_planes(spec, spec.compile(), samples, options.contact, timestep=options.timestep, planes=1)
    model = spec.compile()
    data, table = mujoco.MjData(model), lumen_table(straight_tube(LENGTH), device_radius=BALL)
    data.qfrc_applied[:] = LOAD, along
    wall = TableWall(model, table, options.contact, arcs=np.array([0.05]))
    for _ in range(steps):
        wall.update(data)
        wall.step(data)
    return float(data.qpos[0]), float(data.qvel[1]), wall


@pytest.mark.parametrize("name", ELASTICITIES)
def test_a_ball_at_rest_is_as_deep_as_its_load_by_the_inverse_of_the_law(name: str) -> None:
    depth, _, wall = pushed(SceneOptions(wall_law="table", elasticity=name), along=0.0, steps=200)
    assert depth == pytest.approx(float(depth_under(name, np.array(LOAD), 1500.0)), rel=5e-3)
    hookes = 0.5 * LOAD * depth
    assert 0.6 * hookes < wall.energy() < 1.002 * hookes  # a wall that stiffens holds less
    assert name == "linear" or wall.energy() < 0.95 * hookes


@pytest.mark.parametrize("speed", [0.02, 0.04])
def test_friction_on_mucus_grows_with_the_speed(speed: float) -> None:
    """What drives the ball at twice the speed is (mu + 2 m v) / (mu + m v) times as much."""
    friction, rise = 0.02, 0.78
    options = SceneOptions(wall_law="table", timestep=0.001, friction=friction, friction_rise=rise)
    _, found, _ = pushed(options, along=(friction + rise * speed) * LOAD, steps=1500)
    assert found == pytest.approx(speed, rel=0.01)
