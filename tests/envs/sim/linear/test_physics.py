"""Scopes in linear time: MuJoCo's motion without a wall, Hooke's law and Coulomb's with one."""

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

from haustra.envs.sim.at_origin import compile_at_origin
from haustra.envs.sim.conditions import Conditions
from haustra.envs.sim.linear.backend import LinearBackend
from haustra.envs.sim.physics.lock import lock_activation
from haustra.envs.sim.scope_colon_set import ScopeColonSet, build_bank
from haustra.envs.sim.scope_reading import read_scope
from haustra.envs.sim.state import Controls
from haustra.errors import UnsupportedSceneError
from haustra.models.devices.scope.cable import STOP_SHARE
from haustra.models.devices.scope.library import named_design
from haustra.models.devices.scope.wires import WIRE_NAMES
from haustra.models.scene import SceneOptions, build_scene
from haustra.models.wall.law import SLIP_SPEED
from tests.tube_colon import RADIUS, straight_tube, wedge_wall

_SHORT = SceneOptions(insertion_limit=0.3, shaft_cell=0.0625, bending_cell=0.034, sample_spacing=0.03)
_WEIGHT = 9.81
_STILL = 1e-3
"""Where nothing is faster than this [m/s, rad/s], differences are relative to it."""


def _bank(**changed: Any) -> ScopeColonSet:
    return build_bank([straight_tube()], named_design("adult"), replace(_SHORT, **changed))


def _backend(bank: ScopeColonSet, *, wall: bool = True, **own: Any) -> LinearBackend:
    """One world, in double precision, with a wall as soft as air where none is wanted."""
    backend = LinearBackend(bank.scene, bank.tables, worlds=1, real=np.float64, **own)
    one, options = np.ones(1), bank.scene.options
    stiffness = options.wall_stiffness if wall else 1e-9
    backend.reset(np.zeros(1, int), np.zeros(1, int), Conditions(options.friction * one, stiffness * one, one))
    return backend


def _hands(push: float = 0.0, roll: float = 0.0, pulls: tuple[float, ...] = (0, 0, 0, 0)) -> Controls:
    return Controls(np.full(1, push), np.full(1, roll), np.array([pulls], float))


def test_without_a_wall_it_moves_as_mujoco_does() -> None:
    """Hand, locks, springs, stops at rest, wires and inertia: the same step, to rounding, for 200 steps."""
    bank = _bank()
    scene, model = bank.scene, compile_at_origin(bank.scene)
    data = mujoco.MjData(model)
    data.ctrl[model.actuator("scope/push").id] = 0.05
    data.ctrl[model.actuator("scope/roll").id] = 0.5
    data.ctrl[model.actuator("scope/pull_up").id] = 15.0
    locks = np.array([[model.actuator(name).id for name in pair] for pair in scene.cable.locks])
    behind = scene.cable.length - scene.cable.joint_positions
    backend = _backend(bank, wall=False)
    for _ in range(200):
        held = lock_activation(np, scene.options.start_depth + data.qpos[:1], behind)
        data.ctrl[locks] = held[:, None]
        mujoco.mj_step(model, data)
        assert backend.step(_hands(0.05, 0.5, (15.0, 0, 0, 0)), 1).all()
    np.testing.assert_allclose(backend.positions()[0], data.qpos, atol=1e-8)
    np.testing.assert_allclose(backend.state().hand[0], data.act, atol=1e-12)


def test_one_step_from_each_of_200_states_is_mujocos() -> None:
    """Speeds of joints after a step without a wall, relative to each world's fastest: bound 1e-10."""
    bank, worlds, random = _bank(), 20, np.random.default_rng(0)
    scene, model = bank.scene, compile_at_origin(bank.scene)
    data, one = mujoco.MjData(model), np.ones(worlds)
    names = ["push", "roll", *(f"pull_{wire}" for wire in WIRE_NAMES)]
    hand = [model.actuator(f"scope/{name}").id for name in names]
    locks = np.array([[model.actuator(name).id for name in pair] for pair in scene.cable.locks])
    behind = scene.cable.length - scene.cable.joint_positions
    backend = LinearBackend(scene, bank.tables, worlds=worlds, real=np.float64)
    backend.reset(np.arange(worlds), np.zeros(worlds, int), Conditions(0.1 * one, 1e-9 * one, one))

    def hands() -> Controls:
        rates = random.uniform(-0.1, 0.5, worlds), random.uniform(-1.0, 1.0, worlds)
        return Controls(0.2 * rates[0], rates[1], random.uniform(0.0, 6.0, (worlds, 4)))

    worst = 0.0
    for _ in range(10):
        assert backend.step(hands(), 20).all()
        before, asked = backend.state(), hands()
        assert backend.step(asked, 1).all()
        after = backend.state().qvel
        for world in range(worlds):
            data.qpos[:], data.qvel[:], data.act[:] = before.qpos[world], before.qvel[world], before.hand[world]
            data.ctrl[hand] = [asked.push_rate[world], asked.roll_rate[world], *asked.pulls[world]]
            held = lock_activation(np, scene.options.start_depth + data.qpos[:1], behind)
            data.ctrl[locks] = held[:, None]
            mujoco.mj_step(model, data)
            apart = np.abs(after[world] - data.qvel).max() / max(np.abs(data.qvel).max(), _STILL)
            worst = max(worst, apart)
    assert worst < 1e-10


def test_a_shaft_bends_no_tighter_than_its_smallest_radius() -> None:
    """Held at the anus under a weight that bends the same shaft much further where it may."""
    design = named_design("paediatric")
    design = replace(design, shaft=(replace(design.shaft[0], minimum_bend_radius=0.2),))
    bank = build_bank([straight_tube()], design, replace(_SHORT, gravity=(0.0, -30.0, 0.0), start_depth=0.28))
    model, cells = bank.scene.compile(), bank.scene.cable.cells
    names = [f"scope/bend_{side}_{i:03d}" for i, cell in enumerate(cells) if not cell.steerable for side in "xy"]
    joints = [model.joint(name).qposadr[0] for name in names]

    def most(**own: Any) -> float:
        backend = _backend(bank, wall=False, **own)
        assert backend.step(_hands(), 600).all()
        return float(np.abs(backend.positions()[0][joints]).max())

    scope = read_scope(bank.scene)
    unstopped = scope._replace(low=-np.inf + scope.low, high=np.inf + scope.high)
    stopped = most()
    assert stopped == pytest.approx(STOP_SHARE * cells[0].length / 0.2, rel=0.02)
    assert most(scopes=unstopped) > 1.5 * stopped


def test_a_sphere_at_rest_is_pressed_by_stiffness_times_depth() -> None:
    """Hooke's law, with the depth from where the sphere stands in the round tube (its 48 sides: 0.04 mm)."""
    bank = _bank(friction=0.0, start_depth=0.25)
    backend = _backend(bank)
    assert backend.step(_hands(pulls=(40.0, 0, 0, 0)), 800).all()
    state = backend.state()
    assert np.abs(state.qvel).max() < 1e-3
    model, data = backend.world_data(0)
    spheres = data.geom_xpos[[model.geom(f"wall/sphere_{i:04d}").id for i in range(len(bank.scene.samples))]]
    depth = np.hypot(spheres[:, 0], spheres[:, 1]) + bank.scene.cable.radius - RADIUS
    pressed = depth > 3e-4
    assert pressed.any()
    stiffness = bank.scene.options.wall_stiffness
    np.testing.assert_allclose(state.normal[0][pressed] / stiffness, depth[pressed], atol=6e-5)


def test_friction_holds_below_coulombs_limit_and_slides_above() -> None:
    """A scope that lies in a tube and is pulled along it by 0.5 and 1.5 times its friction."""
    backend = _backend(_bank(gravity=(0.0, -_WEIGHT, 0.0), friction=0.3, start_depth=0.25))
    backend.step(_hands(), 1000)
    backend.step(_hands(0.02), 1000)
    sliding = 0.3 * float(backend.state().normal.sum())
    assert float(backend.read().push_force[0]) == pytest.approx(sliding, rel=0.1)
    backend.step(_hands(), 1000)
    assert abs(backend.state().qvel[0, 0]) < SLIP_SPEED


def test_what_it_cannot_honour_is_refused_by_name() -> None:
    scene = build_scene(straight_tube(), wedge_wall(), named_design("adult"), SceneOptions(insertion_limit=0.3))
    with pytest.raises(UnsupportedSceneError, match="pieces"):
        LinearBackend(scene, _bank().tables, worlds=1)
