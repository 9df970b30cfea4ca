"""One scope in linear time does in a bend what the native backend does in tangent planes, and is recorded alike."""

from dataclasses import replace

import numpy as np
import pytest

from haustra.envs.runs.insertion import run_insertion
from haustra.envs.runs.outcome import Outcome
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.state import Controls
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon

OPTIONS = SceneOptions(
    wall_law="table", softening=False, insertion_limit=0.35, shaft_cell=0.0625, bending_cell=0.034, twist_hinges=2
)
DESIGN = named_design("adult")


@pytest.fixture(scope="module")
def colon():
    return swept_colon(winding([(0.1, 0.0), (0.1, 1.2), (0.2, 0.0)]), name="bent tube")


@pytest.fixture(scope="module")
def field(colon) -> LinearSingle:
    return LinearSingle(build_scene(colon, None, DESIGN, OPTIONS, show_lumen=False))


def test_it_sees_what_the_native_backend_sees(colon, field) -> None:
    """Tip within 1 % of the length inside, forces within 10 % and 0.1 N of those in tangent planes."""
    native = NativeEngine(build_scene(colon, None, DESIGN, replace(OPTIONS, wall_law="planes"), show_lumen=False))
    for instant in range(250):
        inputs = Controls(0.04, 0.1, np.array([0.0, 6.0 * min(1.0, instant / 100), 0.0, 0.0]))
        assert field.step(inputs, 4)
        assert native.step(inputs, 4)
    one, other = field.read(), native.read()
    assert one.time == pytest.approx(other.time, abs=1e-3)
    assert one.insertion == pytest.approx(other.insertion, abs=1e-3)
    assert np.linalg.norm(one.tip - other.tip) < 0.01 * other.insertion
    np.testing.assert_allclose(one.bend, other.bend, atol=0.05)
    assert one.link_forces.shape == other.link_forces.shape
    assert other.link_forces.sum() > 0.5
    assert one.link_forces.sum() == pytest.approx(other.link_forces.sum(), rel=0.1, abs=0.1)
    assert one.push_force == pytest.approx(other.push_force, rel=0.1, abs=0.1)
    assert one.energies.bending == pytest.approx(other.energies.bending, rel=0.1)
    assert one.energies.wall == pytest.approx(other.energies.wall, rel=0.3, abs=1e-4)
    np.testing.assert_allclose(field.shape(), native.shape(), atol=5e-3)


def test_a_run_is_recorded_as_the_native_backends(colon) -> None:
    scene = build_scene(colon, None, DESIGN, OPTIONS, show_lumen=False)
    run = run_insertion(scene, seconds=2.0, backend=LinearSingle)
    assert run.outcome is Outcome.TIME_UP
    model = scene.compile()
    assert run.trajectory.qpos.shape == (100, model.nq)
    assert run.trajectory.ctrl.shape == (100, model.nu)
    assert run.trajectory.insertion[-1] > 0.08
    assert "wall" in scene.left_out
