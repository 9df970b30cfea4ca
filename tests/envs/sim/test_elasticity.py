"""Walls that stiffen with depth, and friction on mucus, in whole scenes: a scope lies in a tube under a great weight.

Theory: where all lies still, each sphere is as deep as the inverse of the law says of the wall's force on it; a scope
that is pushed at a steady speed v meets (mu + m v) times the sum of normal forces.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.linear.single import LinearSingle
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.native_batch import NativeBackend
from haustra.envs.sim.scope_colon_set import build_bank
from haustra.envs.sim.state import Controls
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import Scene, SceneOptions, build_scene
from haustra.models.wall.elasticity import ELASTICITIES, depth_under
from tests.tube_colon import straight_tube

SOFT = 40.0
"""Stiffness of the wall [N/m]."""
LYING = SceneOptions(
    insertion_limit=0.3,
    shaft_cell=0.0625,
    bending_cell=0.034,
    twist_hinges=1,
    start_depth=0.28,
    wall_law="table",
    wall_stiffness=SOFT,
    softening=False,
    gravity=(0.0, -100.0, 0.0),
)
"""Presses a soft wall with some 0.3 N at every sphere: 7 mm deep by Hooke's law."""
DESIGN = named_design("adult")
SETTLE = 300


def scene(**changed: Any) -> Scene:
    return build_scene(straight_tube(), None, DESIGN, replace(LYING, **changed), show_lumen=False)


def squared(xp: Any, depth: Any, stiffness: Any) -> tuple[Any, Any]:
    """E = K d (1 + d / 6 mm), to 20 mm: a law that a user might write."""
    into = xp.clip(depth, 0.0, 0.02)
    slope = 1 + into / 0.003
    return depth - into + into * (1 + into / 0.006) / slope, stiffness * slope


@pytest.fixture(params=["exponential", "squared"])
def law(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """A law that is there, and one that is entered in the registry and nowhere else."""
    monkeypatch.setitem(ELASTICITIES, "squared", squared)
    return request.param


def test_a_scope_lies_as_deep_in_linear_time_as_the_inverse_of_the_law_says(law: str) -> None:
    backend = LinearSingle(scene(elasticity=law))
    assert backend.step(Controls(0.0, 0.0), SETTLE)
    rows = backend.rows()
    normals, deepest = backend.many.normals(rows.state)[0], float(backend.readings(rows).deepest[0])
    assert deepest == pytest.approx(float(depth_under(law, normals.max(keepdims=True), SOFT)[0]), rel=0.01)
    assert deepest < 0.9 * normals.max() / SOFT  # as Hooke's law has it
    assert backend.read().energies.wall < 0.5 * (normals**2).sum() / SOFT


def test_a_scope_lies_as_deep_by_mujoco(law: str) -> None:
    """Tips by the linear law and by another are as far apart as in linear time; so are those of the native batch."""
    found = {}
    for name in ("linear", law):
        own = scene(elasticity=name)
        for make in (LinearSingle, NativeEngine):
            backend: Any = make(own)
            assert backend.step(Controls(0.0, 0.0), SETTLE)
            found[make, name] = backend.read().tip
        bank = build_bank([straight_tube()], DESIGN, own.options)
        batch = NativeBackend(bank.scene, bank.tables, worlds=1)
        batch.reset(np.zeros(1, int), np.zeros(1, int), Conditions(*np.array([[LYING.friction], [SOFT], [1.0]])))
        assert batch.step(Controls(np.zeros(1), np.zeros(1), np.zeros((1, 4))), SETTLE).all()
        found[NativeBackend, name] = batch.read().tip[0]
    rises = {
        make: (found[make, law] - found[make, "linear"])[1] for make in (LinearSingle, NativeEngine, NativeBackend)
    }
    assert rises[LinearSingle] > 5e-4
    for make in (NativeEngine, NativeBackend):
        assert rises[make] == pytest.approx(rises[LinearSingle], rel=0.03)


@pytest.mark.parametrize("make", [LinearSingle, NativeEngine])
def test_a_scope_on_mucus_is_harder_to_push_the_faster(make: Any) -> None:
    friction, rise = 0.02, 0.78
    own = scene(friction=friction, friction_rise=rise, wall_stiffness=1500.0)
    for speed in (0.02, 0.04):
        backend = make(own)
        assert backend.step(Controls(0.0, 0.0), SETTLE)
        assert backend.step(Controls(speed, 0.0), 100)
        pushes, loads = [], []
        for _ in range(40):
            assert backend.step(Controls(speed, 0.0), 1)
            seen = backend.read()
            pushes.append(seen.push_force)
            loads.append(seen.wall_force_sum)
        assert np.mean(pushes) / np.mean(loads) == pytest.approx(friction + rise * speed, rel=0.03)
