"""Newton's method by articulated bodies finds the least that MuJoCo's own solvers look for."""

import mujoco
import numpy as np
import pytest

from haustra.models.wall.compiled import loops
from haustra.models.wall.contact_solver import Tree, step

_LINK = """
<body pos="{x} 0 0">
  <joint name="a{i}" axis="0 {y} {z}" range="-{most} {most}" limited="true" armature="1e-4" damping="1e-3"/>
  <joint name="b{i}" axis="1 0 0" stiffness="0.1" damping="1e-3" armature="1e-4"/>
  <geom name="g{i}" type="capsule" fromto="0 0 0 .05 0 0" size=".006" mass=".01"/>
  {more}
</body>"""

_SCENE = """
<mujoco>
  <option integrator="implicitfast" cone="elliptic" impratio="100" jacobian="dense" solver="Newton"
    tolerance="1e-15" iterations="200" ls_tolerance="1e-9" timestep="0.005"/>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1" pos="0 0 -.004" friction=".2 0 0" condim="{condim}"
      solref="0.02 1" priority="1"/>
    {chain}
  </worldbody>
  {rest}
</mujoco>"""


def _model(*, condim: int = 3, rest: str = "") -> mujoco.MjModel:
    chain = ""
    for i in reversed(range(8)):
        chain = _LINK.format(x=0.05 if i else 0, y=i % 2, z=1 - i % 2, i=i, most=0.1, more=chain)
    return mujoco.MjModel.from_xml_string(_SCENE.format(condim=condim, chain=chain, rest=rest))


def _states(model: mujoco.MjModel, count: int):
    random = np.random.default_rng(0)
    for _ in range(count):
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = random.normal(0, 0.1, model.nq), random.normal(0, 1, model.nv)
        data.qfrc_applied[:] = random.normal(0, 0.01, model.nv)
        yield data


@pytest.mark.parametrize("condim", [1, 3])
def test_steps_are_those_of_mujoco(condim: int) -> None:
    """The problem is strictly convex: it has one least, whoever finds it."""
    model = _model(condim=condim)
    tree, sliding = Tree.of(model), 0
    for data in _states(model, 40):
        mine = mujoco.MjData(model)
        mine.qpos[:], mine.qvel[:], mine.qfrc_applied[:] = data.qpos, data.qvel, data.qfrc_applied
        mujoco.mj_step(model, data)
        step(model, mine, tree, loops().solve)
        sliding += (data.efc_state == mujoco.mjtConstraintState.mjCNSTRSTATE_CONE).any()
        scale = np.abs(data.qacc).max()
        assert mine.qacc == pytest.approx(data.qacc, abs=1e-6 * scale)
        assert mine.qvel == pytest.approx(data.qvel, abs=1e-6 * scale * model.opt.timestep)
        assert mine.efc_force == pytest.approx(data.efc_force, abs=1e-6 * max(1.0, np.abs(data.efc_force).max()))
        assert mine.qfrc_constraint == pytest.approx(data.qfrc_constraint, abs=1e-6)
        assert mine.time == data.time
    assert condim == 1 or sliding > 5


def test_what_it_does_not_know_is_left_to_mujoco() -> None:
    """A constraint between links, or a force on a body, gives MuJoCo's own step."""
    tied = _model(rest='<equality><joint joint1="a1" joint2="a3"/></equality>')
    pushed = _model()
    for model, force in ((tied, 0.0), (pushed, 0.1)):
        for data in _states(model, 3):
            mine = mujoco.MjData(model)
            mine.qpos[:], mine.qvel[:], mine.qfrc_applied[:] = data.qpos, data.qvel, data.qfrc_applied
            data.xfrc_applied[-1, 2] = mine.xfrc_applied[-1, 2] = force
            mujoco.mj_step(model, data)
            step(model, mine, Tree.of(model), loops().solve)
            assert mine.qvel == pytest.approx(data.qvel, rel=1e-9, abs=1e-12)
