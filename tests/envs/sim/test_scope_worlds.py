"""Many scopes in JAX: the native backend's motion without a wall, Hooke's law and Coulomb's with one."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from haustra.envs.sim import chain as links
from haustra.envs.sim.native import NativeEngine
from haustra.envs.sim.scope_bank import ScopeBank, build_bank
from haustra.envs.sim.scope_worlds import JaxScopes
from haustra.envs.sim.state import Controls
from haustra.errors import UnsupportedSceneError
from haustra.models.devices.scope.cable import STOP_SHARE
from haustra.models.devices.scope.library import named_design
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.wall.law import SLIP_SPEED
from tests.bent_colon import winding
from tests.models.wall.conftest import swept_colon
from tests.tube_colon import RADIUS, straight_tube, wedge_wall

_SHORT = SceneOptions(insertion_limit=0.3, shaft_cell=0.0625, bending_cell=0.034, sample_spacing=0.03)
_WEIGHT = 9.81


def _bank(**changed: Any) -> ScopeBank:
    return build_bank([straight_tube()], named_design("adult"), replace(_SHORT, **changed))


def _hands(worlds: int, push: float, pulls: tuple[float, ...] = (0, 0, 0, 0)) -> Controls:
    return Controls(jnp.full(worlds, push), jnp.zeros(worlds), jnp.tile(jnp.array(pulls, float), (worlds, 1)))


def test_without_a_wall_it_moves_as_mujoco_does() -> None:
    """Hand, locks, springs, stops at rest, wires and inertia: the same step, to rounding, for 200 steps."""
    bank = _bank()
    scene = bank.scene
    model = scene.compile()
    data = mujoco.MjData(model)
    data.ctrl[model.actuator("scope/push").id] = 0.05
    data.ctrl[model.actuator("scope/roll").id] = 0.5
    data.ctrl[model.actuator("scope/pull_up").id] = 15.0
    locks = np.array([[model.actuator(name).id for name in pair] for pair in scene.cable.locks])
    with jax.enable_x64(True):
        engine = JaxScopes.of(scene)
        parameters = engine.parameters(scene, 1, kind=jnp.float64, stiffness=1e-9)
        tables = bank.tables_on_device(np.float64)
        hands = Controls(jnp.array([0.05]), jnp.array([0.5]), jnp.array([[15.0, 0, 0, 0]]))
        worlds = engine.begin(parameters, tables)
        step = jax.jit(lambda now: engine.step(tables, parameters, now, hands))
        for _ in range(200):
            data.ctrl[locks] = np.asarray(engine.lock_activation(parameters, worlds))[0].reshape(-1, 2)
            mujoco.mj_step(model, data)
            worlds = step(worlds)
        np.testing.assert_allclose(np.asarray(worlds.qpos[0]), data.qpos, atol=1e-8)
        np.testing.assert_allclose(np.asarray(worlds.hand[0]), data.act, atol=1e-12)


def test_a_shaft_bends_no_tighter_than_its_smallest_radius() -> None:
    """Held at the anus under a weight that bends the same shaft much further where it may."""
    design = named_design("paediatric")
    design = replace(design, shaft=(replace(design.shaft[0], minimum_bend_radius=0.2),))
    bank = build_bank([straight_tube()], design, replace(_SHORT, gravity=(0.0, -30.0, 0.0), start_depth=0.28))
    engine, model, cells = JaxScopes.of(bank.scene), bank.scene.compile(), bank.scene.cable.cells
    tables = bank.tables_on_device()
    hang = jax.jit(lambda its, now: engine.steps(tables, its, now, _hands(1, 0.0), 600))
    names = [f"scope/bend_{side}_{i:03d}" for i, cell in enumerate(cells) if not cell.steerable for side in "xy"]
    joints = [model.joint(name).qposadr[0] for name in names]

    def most(parameters: Any) -> float:
        return float(np.abs(np.asarray(hang(parameters, engine.begin(parameters, tables)).qpos[0]))[joints].max())

    parameters = engine.parameters(bank.scene, 1, stiffness=1e-9)
    unstopped = parameters.scope._replace(low=-np.inf + parameters.scope.low, high=np.inf + parameters.scope.high)
    stopped = most(parameters)
    assert stopped == pytest.approx(STOP_SHARE * cells[0].length / 0.2, rel=0.02)
    assert most(parameters._replace(scope=unstopped)) > 1.5 * stopped


def test_a_sphere_at_rest_is_pressed_by_stiffness_times_depth() -> None:
    """Hooke's law, with the depth from where the sphere stands in the round tube (its 48 sides: 0.04 mm)."""
    bank = _bank(friction=0.0, start_depth=0.25)
    engine = JaxScopes.of(bank.scene)
    tables, parameters = bank.tables_on_device(), engine.parameters(bank.scene, 1)
    hands = _hands(1, 0.0, (40.0, 0, 0, 0))
    worlds = jax.jit(lambda now: engine.steps(tables, parameters, now, hands, 800))(engine.begin(parameters, tables))
    assert np.abs(np.asarray(worlds.qvel)).max() < 1e-3
    where = links.pose(engine.chain, parameters.scope.links, worlds.qpos)
    spheres = np.asarray(links.points_on(where, engine.sample_body, parameters.scope.sample_place))[0]
    depth = np.hypot(spheres[:, 0], spheres[:, 1]) + bank.scene.cable.radius - RADIUS
    pressed = depth > 3e-4
    assert pressed.any()
    stiffness = bank.scene.options.wall_stiffness
    np.testing.assert_allclose(np.asarray(worlds.normal)[0][pressed] / stiffness, depth[pressed], atol=6e-5)


def test_friction_holds_below_coulombs_limit_and_slides_above() -> None:
    """A scope that lies in a tube and is pulled along it by 0.5 and 1.5 times its friction."""
    bank = _bank(gravity=(0.0, -_WEIGHT, 0.0), friction=0.3, start_depth=0.25)
    engine = JaxScopes.of(bank.scene)
    tables, parameters = bank.tables_on_device(), engine.parameters(bank.scene, 1)
    settle = jax.jit(lambda now, push: engine.steps(tables, parameters, now, _hands(1, push), 1000))
    rest = settle(engine.begin(parameters, tables), 0.0)
    pushed = settle(rest, 0.02)
    seen = engine.read(parameters, tables, pushed)
    sliding = 0.3 * float(np.asarray(pushed.normal).sum())
    assert float(seen.push_force[0]) == pytest.approx(sliding, rel=0.1)
    stopped = settle(pushed, 0.0)
    assert np.abs(np.asarray(stopped.qvel[0, 0])) < SLIP_SPEED


def test_it_presses_a_bend_as_tangent_planes_do() -> None:
    """Round a bend of 60 mm: the path and push of the native backend in tangent planes of the same law.

    In between the tip snaps forward along the wall, a little earlier or later; places are compared by their median.
    """
    colon = swept_colon(winding([(0.1, 0.0), (0.12, 2.0), (0.2, 0.0)]), name="bend")
    design = named_design("paediatric")
    options = replace(_SHORT, friction=0.05, insertion_limit=0.35)
    bank = build_bank([colon], design, options)
    engine = JaxScopes.of(bank.scene)
    tables, parameters = bank.tables_on_device(), engine.parameters(bank.scene, 1)
    go = jax.jit(lambda now: engine.steps(tables, parameters, now, _hands(1, 0.05), 100))
    native = NativeEngine(build_scene(colon, None, design, replace(options, wall_law="planes"), show_lumen=False))
    worlds = engine.begin(parameters, tables)
    apart, pushes = [], []
    for _ in range(9):
        worlds = go(worlds)
        assert native.step(Controls(0.05, 0.0), 100)
        seen, known = engine.read(parameters, tables, worlds), native.read()
        place = native.scene.entry + _axes(native) @ np.asarray(seen.tip[0])
        apart.append(float(np.linalg.norm(place - known.tip)))
        pushes.append((float(seen.push_force[0]), known.push_force))
    assert np.median(apart) < 0.0015
    assert apart[-1] < 0.003
    ours, theirs = np.array(pushes)[-2:].T
    assert ours.mean() == pytest.approx(theirs.mean(), rel=0.1)


def test_a_world_that_breaks_is_flagged_and_harms_no_other() -> None:
    bank = _bank()
    engine = JaxScopes.of(bank.scene)
    tables, parameters = bank.tables_on_device(), engine.parameters(bank.scene, 3)
    go = jax.jit(lambda now: engine.steps(tables, parameters, now, _hands(3, 0.05, (5, 0, 0, 0)), 20))
    sound = go(engine.begin(parameters, tables))
    start = engine.begin(parameters, tables)
    broken = go(start._replace(qpos=start.qpos.at[1, 3].set(jnp.nan)))
    assert broken.healthy.tolist() == [True, False, True]
    assert float(broken.time[1]) == 0.0
    np.testing.assert_array_equal(np.asarray(sound.qpos)[[0, 2]], np.asarray(broken.qpos)[[0, 2]])


def test_force_is_differentiable_in_design_and_input() -> None:
    """The gradient of the tip's place by EI is that of finite differences."""
    bank = _bank()
    with jax.enable_x64(True):
        engine = JaxScopes.of(bank.scene)
        tables = bank.tables_on_device(np.float64)

        def tip(bending: Any) -> Any:
            parameters = engine.parameters(bank.scene, 1, kind=jnp.float64, tip_bending=bending)
            hands = _hands(1, 0.0, (10.0, 0, 0, 0))
            worlds = engine.steps(tables, parameters, engine.begin(parameters, tables), hands, 10)
            return engine.read(parameters, tables, worlds).tip[0, 0]

        value = jax.jit(tip)
        slope = jax.jit(jax.grad(tip))(1.0)
        finite = (value(1.001) - value(0.999)) / 0.002
        assert slope == pytest.approx(float(finite), rel=1e-4)
        assert slope != 0


def test_what_it_cannot_honour_is_refused_by_name() -> None:
    scene = build_scene(straight_tube(), wedge_wall(), named_design("adult"), SceneOptions(insertion_limit=0.3))
    with pytest.raises(UnsupportedSceneError, match="pieces"):
        JaxScopes.of(scene)


def _axes(native: NativeEngine) -> np.ndarray:
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, native.scene.spec.body("scope/root").quat)
    return axes.reshape(3, 3)
